"""Errors of recordings.

RecordingsError
├── CaptureError            a capture that cannot be written
└── RecordingError          a file that is not a recording, or lacks a requested part
"""

from robomesh import reason_codes as codes
from robomesh.reasons import Reason


class RecordingsError(Exception):
    """Base of the errors of recordings; the text is one line for people.

    Args:
        reason: A reason from the table; a plain text, as of a damaged file, has the code `other`.

    Attributes:
        reason: The code and its parameters.
    """

    def __init__(self, reason: Reason | str) -> None:
        super().__init__(reason)
        self.reason = codes.OTHER(detail=reason) if isinstance(reason, str) else reason


class CaptureError(RecordingsError):
    """A capture that cannot be written."""


class RecordingError(RecordingsError):
    """A file that is not a recording, or lacks a requested part; a plain text is `recording.unreadable`."""

    def __init__(self, reason: Reason | str) -> None:
        super().__init__(reason)
        if isinstance(reason, str):
            self.reason = codes.RECORDING_UNREADABLE(self.reason)
