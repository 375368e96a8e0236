"""Audit log of a robot: its requests, their senders and outcomes.

What an entry says is decided in `authority`; `persistence` has the latch file of a stop.
"""
