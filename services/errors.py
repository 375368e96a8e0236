"""Errors of the services.

ServiceError
├── SiteFileError           a site file that cannot be read, or says something wrong
└── ListenError             an address that cannot be listened on
"""


class ServiceError(Exception):
    """Base of the services' errors; its text is one line (or a line a problem) for people."""


class SiteFileError(ServiceError):
    """A site file that cannot be read, or says something wrong."""


class ListenError(ServiceError):
    """An address that cannot be listened on: taken, not ours, or beyond loopback without leave."""
