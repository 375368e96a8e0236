"""Kinds of controllers, a folder each: driver, settings, probe, simulated controller, codes.

Kinds share `simulated` and `probing` only; what drivers share belongs to `protocol_gateway.driver_parts`.
"""
