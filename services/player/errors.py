"""Errors of the player.

ServiceError
└── ReplayError             a recording cannot be played, or a request to a replay is invalid
"""

from robomesh.reasons import Reason
from services.errors import ServiceError


class ReplayError(ServiceError):
    """A recording cannot be played, or a request to a replay is invalid; `reason` says why."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason.text)
        self.reason = reason
