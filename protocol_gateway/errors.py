"""The errors of the seam, for drivers of packages; robomesh itself imports `protocol_gateway.seam.errors`."""

from protocol_gateway.seam.errors import *  # noqa: F403
