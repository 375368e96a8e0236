"""Simulated controller of Universal Robots' kind: RTDE and the primary interface, for reading."""
