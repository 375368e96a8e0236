"""Content of the cells that motions are checked against, and its changes while the gateway runs.

The check itself belongs to `checking`.
"""
