"""Audit log of a robot: its requests, their senders, and their outcomes."""
