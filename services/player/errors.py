"""Errors of the player.

ServiceError
└── ReplayError             what cannot be played, or asked of a replay
"""

from robomesh.reasons import Reason
from services.errors import ServiceError


class ReplayError(ServiceError):
    """A recording that cannot be played, or a request that a replay cannot do; `reason` says why."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason.text)
        self.reason = reason
