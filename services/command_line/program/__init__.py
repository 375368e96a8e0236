"""`robomesh program`: teach programs."""
