"""`robomesh accounts`."""
