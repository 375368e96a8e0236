"""Errors of a site's keys."""

from services.errors import ServiceError


class KeysError(ServiceError):
    """Keys, certificates or their list are missing, invalid or cannot be made."""
