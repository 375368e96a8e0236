"""Commands for the console's accounts: people, passwords, tokens of views."""
