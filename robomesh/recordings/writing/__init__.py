"""Writing of recordings: capture, and the writer of a file with an index."""
