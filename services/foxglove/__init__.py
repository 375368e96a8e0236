"""The mesh for Foxglove and Lichtblick: one WebSocket server of theirs."""

from services.foxglove.server import serve
from services.foxglove.settings import Settings

__all__ = ["Settings", "serve"]
