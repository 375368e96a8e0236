"""What everything on the mesh shares: topics, keys, messages, sessions, requests, presence, services."""
