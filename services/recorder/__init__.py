"""Recorder service: captures of a robot's topics as self-contained MCAP files."""

from services.recorder.attachments import without_secrets
from services.recorder.recorder import serve
from services.recorder.settings import Settings, Split, flight_of, marks_of

__all__ = ["Settings", "Split", "flight_of", "marks_of", "serve", "without_secrets"]
