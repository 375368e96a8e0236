"""The console's accounts: roles, passwords, sessions, rights, and their HTTP routes."""
