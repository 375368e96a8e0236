"""Errors of recordings.

RecordingsError             a CodedError
├── CaptureError            a capture that cannot be written
└── RecordingError          a file that is not a recording, or lacks a requested part
"""

from robomesh import reason_codes as codes
from robomesh.errors import CodedError
from robomesh.reasons import Reason


class RecordingsError(CodedError):
    """Base of the errors of recordings."""


class CaptureError(RecordingsError):
    """A capture that cannot be written."""


class RecordingError(RecordingsError):
    """A file that is not a recording, or lacks a requested part; a plain text is `recording.unreadable`."""

    def __init__(self, reason: Reason | str) -> None:
        super().__init__(reason)
        if isinstance(reason, str):
            self.reason = codes.RECORDING_UNREADABLE(self.reason)
