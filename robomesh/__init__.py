"""The library that all programs of the mesh share: topics, keys, messages, sessions, requests, services."""
