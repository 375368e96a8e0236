"""The watch of a site: its alarms, and the mesh as it sees it."""
