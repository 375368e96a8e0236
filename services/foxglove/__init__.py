"""Bridge to Foxglove and Lichtblick: the mesh's robots on a WebSocket server of Foxglove's SDK."""

from services.foxglove.server import serve
from services.foxglove.settings import Settings

__all__ = ["Settings", "serve"]
