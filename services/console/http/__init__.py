"""What the console serves over HTTP."""
