"""TCP clients of a server of units, and their limits.

Used by `legacy` and by the simulated controller of the unit protocol.
"""
