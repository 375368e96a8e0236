"""Recordings as MCAP files that explain themselves: written, finished, recovered, read."""
