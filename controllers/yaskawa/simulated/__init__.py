"""Simulated controller of Yaskawa's kind with the High-Speed Ethernet Server."""
