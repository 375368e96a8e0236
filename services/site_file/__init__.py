"""The site file as a whole, and the file of robots that were started from the page."""
