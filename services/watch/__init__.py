"""The watch of a site: its alarms, and conditions of the mesh. It reports; it commands nothing."""
