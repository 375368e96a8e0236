"""Commands for what happened: alarms, audit entries, notes."""
