"""Errors of the console.

services.errors.ServiceError
├── RefusedRequest              a refused HTTP request, with its status
│   └── TooSlowError            a job of Define exceeded its time limit
├── AccountsError               an accounts file, or a change to it, is invalid
├── SignInError                 a sign-in is refused
│   └── SignInBusyError         too many sign-ins wait for verification
├── PageNotBuiltError           the page is not built
└── WatchError                  a browser watches an invalid key, or breaks the page's protocol
"""

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from services.errors import ServiceError


class RefusedRequest(ServiceError):
    """A refused HTTP request.

    Args:
        more: Further keys of the answer, if it is JSON.

    Attributes:
        status: HTTP status.
        reason: The code and its parameters.
        again_s: Time after which to retry [s]; None if unknown.
    """

    def __init__(self, status: int, reason: Reason, *, again_s: float | None = None, **more: object) -> None:
        super().__init__(reason.text)
        self.status, self.reason, self.again_s, self.more = status, reason, again_s, more


class TooSlowError(RefusedRequest):
    """A job of Define exceeded its time limit and was stopped."""


class AccountsError(ServiceError):
    """An accounts file, or a change to it, is invalid.

    Args:
        reason: A reason from the table; a plain text has the code `account.failed`.

    Attributes:
        reason: The code and its parameters.
    """

    def __init__(self, reason: Reason | str) -> None:
        super().__init__(str(reason))
        self.reason = codes.ACCOUNT_FAILED(detail=reason) if isinstance(reason, str) else reason


class SignInError(ServiceError):
    """A refused sign-in.

    Attributes:
        reason: The code and its parameters.
        wait_s: Time until the next allowed attempt [s]; 0: the name or the password was wrong.
    """

    def __init__(self, reason: Reason, wait_s: float = 0.0) -> None:
        super().__init__(reason.text)
        self.reason, self.wait_s = reason, wait_s


class SignInBusyError(SignInError):
    """Too many sign-ins wait for verification."""

    def __init__(self) -> None:
        super().__init__(codes.ACCOUNT_BUSY(), wait_s=1.0)


class PageNotBuiltError(ServiceError):
    """The page is not built."""


class WatchError(ServiceError):
    """A browser watches an invalid key, or breaks the page's protocol.

    Attributes:
        reason: The code and its parameters.
    """

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason.text)
        self.reason = reason
