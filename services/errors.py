"""Errors of the services.

ServiceError
├── SiteFileError           a site file cannot be read, or a value in it is invalid
└── ListenError             a service cannot listen on an address
    └── UnavailableError    it cannot now: the address is in use, or not there
"""

import os

# Exit status of a service that cannot run now; status 2 says that its configuration is wrong.
TRY_AGAIN = os.EX_TEMPFAIL


class ServiceError(Exception):
    """Base of the services' errors; the text has one line for each problem and is for the operator."""


class SiteFileError(ServiceError):
    """A site file cannot be read, or a value in it is invalid."""


class ListenError(ServiceError):
    """A service cannot listen on an address: in use, unavailable, or not permitted."""


class UnavailableError(ListenError):
    """A service cannot listen on an address now: another program uses it, or its network is not there yet."""
