"""High-Speed Ethernet Server of Yaskawa's controllers (HSES), without I/O."""
