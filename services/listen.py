"""Addresses to listen on: HOST:PORT, and what may be reached from elsewhere."""

import ipaddress

from services.errors import ListenError


def split_address(text: str) -> tuple[str, int]:
    """Host and port of `HOST:PORT`.

    Raises:
        ListenError: If it is not that.
    """
    host, colon, port = text.rpartition(":")
    if not colon or not host or not port.isdigit() or int(port) > 65535:
        raise ListenError(f"{text!r} is not an address: HOST:PORT is right, as in 127.0.0.1:8080")
    return host.strip("[]"), int(port)


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach what listens there."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def check_reach(what: str, host: str, *, secured: bool, insecure: bool) -> str | None:
    """The warning that listening there deserves; None where it needs none.

    Args:
        secured: TLS guards it.
        insecure: The site file takes the risk in so many words.

    Raises:
        ListenError: If it is beyond loopback, not secured, and nobody took the risk.
    """
    if is_loopback(host) or secured:
        return None
    if not insecure:
        raise ListenError(
            f"{what} would listen on {host}, which others can reach, without TLS: give it "
            "tls = { ca, certificate, key }, listen on 127.0.0.1, or write insecure = true"
        )
    return f"{what} listens on {host} without TLS (insecure = true): anybody who can reach it can use it"
