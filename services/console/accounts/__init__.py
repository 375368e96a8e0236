"""The console's accounts: roles, passwords, sessions and rights."""
