"""Captures of what a robot publishes, as MCAP files that explain themselves."""

from services.recorder.recorder import Settings, serve

__all__ = ["Settings", "serve"]
