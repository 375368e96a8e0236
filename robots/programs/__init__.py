"""Teach programs: text, motion plan, and the check of a motion before it is executed.

This file imports nothing, so a process that only forwards steps needs no coal and no Pinocchio.
"""
