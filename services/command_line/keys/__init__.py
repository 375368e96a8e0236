"""`robomesh keys`."""
