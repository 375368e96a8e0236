"""Parts of a TCP server of units: its clients, their limits and sockets.

Used by `legacy` and by the simulated controller of the unit protocol.
"""
