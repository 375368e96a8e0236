"""Who may use the console: accounts and their roles, passwords, sessions, and what each may ask."""
