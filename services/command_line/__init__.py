"""The command line: it turns words into Settings and calls, and holds no other logic."""
