"""The player: a recording on the mesh again, as a robot of its own that nobody can move."""

from services.player.player import Settings, serve

__all__ = ["Settings", "serve"]
