"""Interfaces of a Universal Robots controller (RTDE, primary, dashboard), without I/O and without motion."""
