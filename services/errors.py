"""Errors of the services.

ServiceError
├── SiteFileError           a site file cannot be read, or a value in it is invalid
└── ListenError             a service cannot listen on an address
"""


class ServiceError(Exception):
    """Base of the services' errors; the text has one line for each problem and is for the operator."""


class SiteFileError(ServiceError):
    """A site file cannot be read, or a value in it is invalid."""


class ListenError(ServiceError):
    """A service cannot listen on an address: in use, unavailable, or not permitted."""
