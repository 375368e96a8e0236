"""`robomesh record` and `robomesh recordings`: what is recorded, played back, exported."""
