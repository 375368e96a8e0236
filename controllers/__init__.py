"""Kinds of controllers, a folder each: driver, settings, probe, simulated controller, codes."""
