"""`robomesh mesh`: mesh files."""
