"""The watch of a site: its alarms, and the mesh as it sees it."""

from services.watch.watch import Settings, serve

__all__ = ["Settings", "serve"]
