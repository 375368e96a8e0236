"""Simulated controller of FANUC's kind with SNPX, for reading."""
