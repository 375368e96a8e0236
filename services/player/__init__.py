"""Player service: publishes a recording as a separate robot that cannot be commanded."""

from services.player.player import Settings, serve

__all__ = ["Settings", "serve"]
