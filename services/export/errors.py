"""Errors of the commands about recordings.

ServiceError
└── ExportError             a recording cannot be exported, fetched or played
"""

from services.errors import ServiceError


class ExportError(ServiceError):
    """A recording cannot be exported, fetched or played."""
