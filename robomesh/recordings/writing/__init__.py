"""Writing of recordings: capture, index, recover."""
