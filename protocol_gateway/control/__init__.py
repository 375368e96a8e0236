"""Handling of requests to move or control one robot: evaluated, audited, executed, answered."""
