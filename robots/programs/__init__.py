"""Teach programs: text, motion plan, and the check of a motion before it is executed.

This file imports nothing, so a process that only forwards steps or stores texts needs no coal and no
Pinocchio.
"""

MOST_BYTES = 64 * 1024
"""Longest text of a program [bytes]."""
