"""Errors of the console.

services.errors.ServiceError
├── AccountsError           an accounts file, or a change of it, that cannot be
├── SignInBusyError         too many passwords wait to be looked at
├── PageNotBuiltError       there is no page to serve
├── PictureError            a picture that cannot be given, with HTTP's status
├── RecordingChangedError   a recording that was written again while it was sent
└── WatchError              a browser asked for a key that it cannot watch
"""

from services.errors import ServiceError


class AccountsError(ServiceError):
    """An accounts file that says something wrong, or a change of it that cannot be.

    Attributes:
        word: Which, for the page, which has words of its own; "refused": its text is all there is.
    """

    def __init__(self, text: str, word: str = "refused") -> None:
        super().__init__(text)
        self.word = word


class SignInBusyError(ServiceError):
    """Too many passwords wait to be looked at."""


class PageNotBuiltError(ServiceError):
    """There is no page to serve."""


class WatchError(ServiceError):
    """A browser asked for a key that it cannot watch; the text says what it can."""


class RecordingChangedError(ServiceError):
    """A recording that was written again while it was sent."""


class PictureError(ServiceError):
    """A picture that cannot be given; the text says why and what can.

    Attributes:
        status: HTTP's.
        again_s: When to ask again [s]; None: nobody knows.
    """

    def __init__(self, status: int, text: str, *, again_s: float | None = None) -> None:
        super().__init__(text)
        self.status, self.again_s = status, again_s
