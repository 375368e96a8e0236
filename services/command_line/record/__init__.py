"""Commands for what is kept: recordings, audit entries, notes."""
