"""Errors of the commands about recordings.

ServiceError
└── ExportError             what cannot be made of a recording, or fetched
"""

from services.errors import ServiceError


class ExportError(ServiceError):
    """What cannot be made of a recording, or fetched."""
