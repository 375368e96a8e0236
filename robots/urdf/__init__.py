"""URDF: robots read from it, and written as it."""
