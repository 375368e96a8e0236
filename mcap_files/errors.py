"""Errors of recordings.

RecordingsError
├── CaptureError            a capture that cannot be written
└── RecordingError          a file that is not a recording, or lacks a requested part
"""


class RecordingsError(Exception):
    """Base of the errors of recordings; the text is one line for people."""


class CaptureError(RecordingsError):
    """A capture that cannot be written."""


class RecordingError(RecordingsError):
    """A file that is not a recording, or lacks a requested part."""
