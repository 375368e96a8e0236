"""Parts that all programs share: command line, turns, processes, sites, simulated controllers; no figure."""
