"""Commands that check: this machine, every role's rights, a controller's port, the versions."""
