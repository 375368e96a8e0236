"""The store of a site: programs with all their versions, notes, layouts. It runs no program."""
