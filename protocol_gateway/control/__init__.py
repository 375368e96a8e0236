"""Requests to move or control one robot: judged, written down, done, answered."""
