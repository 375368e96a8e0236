"""Recordings for asynchronous programs, of this machine and of the sites' recorders."""
