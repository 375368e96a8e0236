"""`robomesh doctor`: this machine, and with `--security` the rights of every role on the mesh."""
