"""Listening addresses, HOST:PORT, and whether other machines can reach them."""

import ipaddress
from collections.abc import Iterable

from robomesh.errors import ListenError


def split_address(text: str) -> tuple[str, int]:
    """Split `HOST:PORT` into host and port.

    Raises:
        ListenError: If the text has another form.
    """
    host, colon, port = text.rpartition(":")
    if not colon or not host or not port.isdigit() or int(port) > 65535:
        raise ListenError(f"{text!r} is not an address: must be HOST:PORT, as in 127.0.0.1:8080")
    return host.strip("[]"), int(port)


def is_loopback(host: str) -> bool:
    """Return whether only this machine can reach an address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def same_address(one: str, other: str) -> bool:
    """Return whether two addresses are equal; port 0 is any free port and equals no other.

    Raises:
        ListenError: If one is not an address.
    """
    (host, port), (host_2, port_2) = split_address(one), split_address(other)
    return port == port_2 != 0 and _plain(host) == _plain(host_2)


def cannot_both_listen(one: str, other: str) -> bool:
    """Return whether two addresses are equal, or one covers the other by listening on every interface.

    Raises:
        ListenError: If one is not an address.
    """
    (host, port), (host_2, port_2) = split_address(one), split_address(other)
    hosts = (host, host_2)
    everywhere = "::" in hosts or ("0.0.0.0" in hosts and ":" not in host + host_2)
    return same_address(one, other) or (port == port_2 != 0 and everywhere)


def _plain(host: str) -> str:
    return "127.0.0.1" if host.lower() == "localhost" else host.lower()


def reachable(endpoint: str) -> str:
    """Return a listening endpoint as an address that this machine can connect to."""
    protocol, _, rest = endpoint.partition("/")
    address, question, options = rest.partition("?")
    host, port = split_address(address)
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)
    shown = f"[{host}]" if ":" in host else host
    return f"{protocol}/{shown}:{port}{question}{options}"


def own_addresses(endpoints: Iterable[str]) -> tuple[str, ...]:
    """Return listening endpoints as `reachable` does, those of loopback first: others may come late."""

    def is_elsewhere(endpoint: str) -> bool:
        return not is_loopback(split_address(endpoint.partition("/")[2].partition("?")[0])[0])

    return tuple(sorted(map(reachable, endpoints), key=is_elsewhere))


_IN_THE_SITE_FILE = "give it tls = { ca, certificate, key }, listen on 127.0.0.1, or write insecure = true"


def check_reach(
    what: str, host: str, *, secured: bool, insecure: bool, remedy: str = _IN_THE_SITE_FILE
) -> str | None:
    """Check who can reach an address; return a warning, or None.

    Args:
        secured: TLS protects it.
        insecure: The site file (or an option) accepts the risk explicitly.
        remedy: Advice for the error's text.

    Raises:
        ListenError: If other machines can reach it, without TLS and without `insecure`.
    """
    if is_loopback(host) or secured:
        return None
    if not insecure:
        raise ListenError(f"{what} would listen on {host}, which others can reach, without TLS: {remedy}")
    return f"{what} listens on {host} without TLS (insecure = true): any machine that reaches it can use it"


def check_page_reach(host: str, *, accounts: bool, tls: bool, insecure: bool) -> str | None:
    """Check who can reach the page; return a warning, or None.

    Args:
        accounts: Its users sign in.
        insecure: The site file accepts the risk explicitly.

    Raises:
        ListenError: If other machines can reach it, without accounts or TLS, and without `insecure`.
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
    return f"the console listens on {host} without {without} (insecure = true): anyone who reaches it " + (
        "can read what is sent, passwords included" if accounts else "can use it"
    )
