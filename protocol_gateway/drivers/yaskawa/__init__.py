"""High-Speed Ethernet Server of Yaskawa's controllers (HSES), read only, without I/O."""
