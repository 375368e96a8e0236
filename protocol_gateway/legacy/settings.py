"""Where old client programs attach to a robot's gateway, and what they may do."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from ipaddress import IPv6Address, ip_address

from protocol_gateway.serving.rate_limit import Limits


@dataclass(frozen=True, kw_only=True)
class LegacySettings:
    """Where old client programs attach to a robot, and what they may do.

    Attributes:
        commanders: Operators' names by the addresses that may command, as `plain_address` writes them.
        most: Clients at once.
        limits: Of what each may send.
    """

    host: str
    port: int
    commanders: Mapping[str, str] = field(default_factory=dict)
    most: int = 16
    limits: Limits = field(default_factory=Limits)


def plain_address(text: str) -> str:
    """An IP address in one way of writing, an IPv4 one that comes by IPv6 too.

    Raises:
        ValueError: If it is none.
    """
    address = ip_address(text)
    if isinstance(address, IPv6Address) and address.ipv4_mapped is not None:
        return str(address.ipv4_mapped)
    return str(address)
