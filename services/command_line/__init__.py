"""The command line: translates words into Settings and calls; knows no more than that."""
