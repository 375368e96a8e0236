"""A site's services: their table, their Settings from the site file, their metrics' ports. Starts none."""
