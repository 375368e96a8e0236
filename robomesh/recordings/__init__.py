"""Recordings as self-describing MCAP files: records, names, descriptions, reading by topic and time.

Writing is in `writing`; the values in the messages are in `series`.
"""
