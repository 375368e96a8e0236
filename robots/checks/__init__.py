"""Checks of a motion before it is made: duration, limits, collisions, clearances and singularities.

Programs without a check belong to `programs`.
"""
