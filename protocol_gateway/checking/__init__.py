"""Collision checks of motions before they start: in the gateway's worker processes, not over the network."""
