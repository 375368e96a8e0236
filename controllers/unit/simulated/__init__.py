"""Simulated controller with the paper's protocol: a TCP server that moves any described arm."""
