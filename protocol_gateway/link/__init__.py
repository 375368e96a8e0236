"""The link to one controller: its connection, its health, the dates of what comes over it."""
