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


def same_address(one: str, other: str) -> bool:
    """Whether two addresses are the same; port 0 is a free one, and nobody else's.

    Raises:
        ListenError: If one is none.
    """
    (host, port), (host_2, port_2) = split_address(one), split_address(other)
    return port == port_2 != 0 and _plain(host) == _plain(host_2)


def cannot_both_listen(one: str, other: str) -> bool:
    """Whether two addresses are the same, or one is of every interface and holds the other.

    Raises:
        ListenError: If one is none.
    """
    (host, port), (host_2, port_2) = split_address(one), split_address(other)
    hosts = (host, host_2)
    everywhere = "::" in hosts or ("0.0.0.0" in hosts and ":" not in host + host_2)
    return same_address(one, other) or (port == port_2 != 0 and everywhere)


def _plain(host: str) -> str:
    return "127.0.0.1" if host.lower() == "localhost" else host.lower()


def reachable(endpoint: str) -> str:
    """A router's listening endpoint as one that its own machine can connect to."""
    protocol, _, rest = endpoint.partition("/")
    address, question, options = rest.partition("?")
    host, port = split_address(address)
    host = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(host, host)
    return f"{protocol}/{host}:{port}{question}{options}"


_IN_THE_SITE_FILE = "give it tls = { ca, certificate, key }, listen on 127.0.0.1, or write insecure = true"


def check_reach(
    what: str, host: str, *, secured: bool, insecure: bool, remedy: str = _IN_THE_SITE_FILE
) -> str | None:
    """The warning that listening there deserves; None where it needs none.

    Args:
        secured: TLS guards it.
        insecure: The site file (or an option) takes the risk in so many words.
        remedy: What to do where it may not.

    Raises:
        ListenError: If it is beyond loopback, not secured, and nobody took the risk.
    """
    if is_loopback(host) or secured:
        return None
    if not insecure:
        raise ListenError(f"{what} would listen on {host}, which others can reach, without TLS: {remedy}")
    return f"{what} listens on {host} without TLS (insecure = true): anybody who can reach it can use it"


def check_page_reach(host: str, *, accounts: bool, tls: bool, insecure: bool) -> str | None:
    """The warning that serving the page there deserves; None where it needs none.

    Args:
        accounts: Who uses it signs in.
        insecure: The site file takes the risk in so many words.

    Raises:
        ListenError: If others can reach it, it has not both accounts and TLS, and nobody took the risk.
    """
    lacks = [what for what, there in (("accounts", accounts), ("TLS", tls)) if not there]
    if is_loopback(host) or not lacks:
        return None
    without = " and without ".join(lacks)
    if not insecure:
        raise ListenError(
            f"the console would listen on {host}, which others can reach, without {without}: give it "
            'accounts = "accounts.toml" and tls = { certificate, key }, listen on 127.0.0.1, '
            "or write insecure = true"
        )
    return f"the console listens on {host} without {without} (insecure = true): whoever can reach it " + (
        "can read what is sent, passwords too" if accounts else "can use it"
    )
