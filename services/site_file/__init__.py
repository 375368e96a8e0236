"""The site file: its parts, and the robots that were started from the page."""
