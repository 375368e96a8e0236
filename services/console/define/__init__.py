"""The server's part of the page's Define: files, checks, conversions, saving, starting."""
