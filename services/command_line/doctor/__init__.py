"""`robomesh doctor`: checks of this machine, and with `--security` of every role's rights."""
