"""Teach programs: their text, their statements, curves from DXF, and the plan of their motion.

A program's check belongs to `checks`.

This file imports nothing, so a process that only forwards steps or stores texts needs no coal and no
Pinocchio.
"""

MOST_BYTES = 64 * 1024
"""Longest text of a program [bytes]."""
