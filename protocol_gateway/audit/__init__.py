"""Audit log of a robot: its requests, their senders and outcomes; and the latch file of a stop.

What an entry says is decided in `authority`.
"""
