"""Errors of recordings.

RecordingsError
├── CaptureError            a capture that cannot be written
└── RecordingError          a file that is no recording, or a part of it that is not there
"""


class RecordingsError(Exception):
    """Base of the errors of recordings; its text is one line for people."""


class CaptureError(RecordingsError):
    """A capture that cannot be written."""


class RecordingError(RecordingsError):
    """A file that is no recording, or a part of it that is not there."""
