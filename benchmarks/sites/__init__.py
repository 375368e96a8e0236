"""Programs that measure a whole site: its start, hours of work, its recorder."""
