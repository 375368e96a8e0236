"""Errors of a site's keys."""

from services.errors import ServiceError


class KeysError(ServiceError):
    """Keys, certificates or their list that are not there, not right, or not to be made so."""
