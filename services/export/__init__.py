"""A part of a recording, and its video rendered from joints: for the console and the command line."""
