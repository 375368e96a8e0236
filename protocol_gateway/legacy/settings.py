"""Settings for old client programs of one robot."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from ipaddress import IPv6Address, ip_address

from protocol_gateway.unit_server.rate_limit import Limits


@dataclass(frozen=True, kw_only=True)
class LegacySettings:
    """Address for old client programs of one robot, and their rights.

    Attributes:
        commanders: Operator names by the addresses that may command, normalized by `plain_address`.
        most: Maximum number of connected clients.
        limits: Rate limits of each client.
    """

    host: str
    port: int
    commanders: Mapping[str, str] = field(default_factory=dict)
    most: int = 16
    limits: Limits = field(default_factory=Limits)


def plain_address(text: str) -> str:
    """Normalize an IP address, and an IPv4-mapped IPv6 address to IPv4.

    Raises:
        ValueError: If the text is not an IP address.
    """
    address = ip_address(text)
    if isinstance(address, IPv6Address) and address.ipv4_mapped is not None:
        return str(address.ipv4_mapped)
    return str(address)
