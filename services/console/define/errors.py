"""Errors of Define's server.

services.errors.ServiceError
└── RefusedRequest      a request that is answered in words, with an HTTP status
    └── TooSlowError    a job that took longer than its worker gives it
"""

from services.errors import ServiceError


class RefusedRequest(ServiceError):
    """A request that is answered in words.

    Attributes:
        status: Of HTTP.
        text: For people.
    """

    def __init__(self, status: int, text: str) -> None:
        self.status = status
        self.text = text
        super().__init__(text)


class TooSlowError(RefusedRequest):
    """A job took longer than its worker gives it, and was ended."""
