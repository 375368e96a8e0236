"""Teach programs: their text, the motion that they come to, and its check before it is made.

Nothing is imported here: whoever only passes steps on needs no coal and no Pinocchio.
"""
