"""Errors of the console.

services.errors.ServiceError
├── PageNotBuiltError       there is no page to serve
└── WatchError              a browser asked for a key that it cannot watch
"""

from services.errors import ServiceError


class PageNotBuiltError(ServiceError):
    """There is no page to serve."""


class WatchError(ServiceError):
    """A browser asked for a key that it cannot watch; the text says what it can."""
