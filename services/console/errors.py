"""Errors of the console.

services.errors.ServiceError
├── AccountsError           an accounts file, or a change to it, is invalid
├── SignInBusyError         too many sign-ins wait for verification
├── PageNotBuiltError       the page is not built
├── PictureError            a picture is not available; has an HTTP status
├── RecordingChangedError   a recording was replaced during a download
└── WatchError              a browser watches an invalid key
"""

from services.errors import ServiceError


class AccountsError(ServiceError):
    """An accounts file, or a change to it, is invalid.

    Attributes:
        word: Identifies the error for the page, which has its own text; "refused": show the error's text.
    """

    def __init__(self, text: str, word: str = "refused") -> None:
        super().__init__(text)
        self.word = word


class SignInBusyError(ServiceError):
    """Too many sign-ins wait for verification."""


class PageNotBuiltError(ServiceError):
    """The page is not built."""


class WatchError(ServiceError):
    """A browser watches an invalid key; the text says which are valid."""


class RecordingChangedError(ServiceError):
    """A recording was replaced during a download."""


class PictureError(ServiceError):
    """A picture is not available; the text says why, and which are.

    Attributes:
        status: HTTP status.
        again_s: Time after which to retry [s]; None if unknown.
    """

    def __init__(self, status: int, text: str, *, again_s: float | None = None) -> None:
        super().__init__(text)
        self.status, self.again_s = status, again_s
