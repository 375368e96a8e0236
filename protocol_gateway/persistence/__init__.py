"""State that a robot keeps over a restart of the gateway: the latch file of a stop, and the log's summary.

What it is decided from is in `authority`; `audit` writes the log itself.
"""
