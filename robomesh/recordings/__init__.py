"""Recordings as self-describing MCAP files: write, index, recover and read them."""
