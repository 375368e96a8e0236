"""The site file's parts, and the file of robots that were started from the page."""
