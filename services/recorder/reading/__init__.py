"""Requests for what recordings contain, and the process that reads the files. Writes nothing."""
