"""Simulated controller with the unit protocol: a TCP server that moves any described arm."""
