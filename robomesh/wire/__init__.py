"""A session: its connections, presence, last values and counters.

It joins publications and requests; what only one of the two needs is in its own room.
"""
