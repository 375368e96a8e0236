"""Collision checks of motions before they start, in the gateway's worker processes.

No check is a request over the network. The geometry belongs to `robots.checks`.
"""
