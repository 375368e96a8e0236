"""Errors of the player.

ServiceError
└── ReplayError             what cannot be played, or asked of a replay
"""

from services.errors import ServiceError


class ReplayError(ServiceError):
    """What cannot be played, or asked of a replay."""
