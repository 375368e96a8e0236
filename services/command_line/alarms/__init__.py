"""`robomesh alarms`."""
