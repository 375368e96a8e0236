"""`robomesh audit`."""
