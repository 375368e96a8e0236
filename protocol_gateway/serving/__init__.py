"""TCP clients of a server of units (a simulated controller or the gateway), and their limits."""
