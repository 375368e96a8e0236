"""Simulated Yaskawa controller with the High-Speed Ethernet Server, and the arm behind it."""
