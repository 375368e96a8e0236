"""Commands that act on a robot and its cell: send, fault, cell."""
