"""Errors of Define's server.

services.errors.ServiceError
└── RefusedRequest      a refused request, with an HTTP status and a sentence
└── TooSlowError    a job exceeded its time limit
"""

from services.errors import ServiceError


class RefusedRequest(ServiceError):
    """A refused request.

    Attributes:
        status: HTTP status.
        text: Sentence for the user.
    """

    def __init__(self, status: int, text: str) -> None:
        self.status = status
        self.text = text
        super().__init__(text)


class TooSlowError(RefusedRequest):
    """A job exceeded its time limit and was stopped."""
