"""Errors of the services.

ServiceError
└── SiteFileError           a site file cannot be read, or a value in it is invalid
"""

import os

# Exit status of a service that cannot run now; status 2 says that its configuration is wrong.
TRY_AGAIN = os.EX_TEMPFAIL


class ServiceError(Exception):
    """Base of the services' errors; the text has one line for each problem and is for the operator."""


class SiteFileError(ServiceError):
    """A site file cannot be read, or a value in it is invalid."""
