"""`robomesh record` and `robomesh recordings`: record, list, play, export and fetch."""
