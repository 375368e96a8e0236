"""Protocols of Universal Robots' controllers: RTDE and the primary interface, read only, without I/O."""
