"""A session: its connections, presence, last values and counters. It joins publications and requests."""
