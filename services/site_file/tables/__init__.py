"""The site file's tables, each with its keys, ranges and descriptions. Not the whole file (`site.py`)."""
