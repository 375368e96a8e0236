"""Zenoh configurations: a client of a router, and a router."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import zenoh

from robomesh.contract.topics import Priority
from robomesh.errors import SessionError

DEFAULT_ROUTER = "tcp/127.0.0.1:7447"
# A host that is silent for this long is gone, and control of its operators ends. It detects a frozen host
# after 1.7 s; Zenoh's default after 10 s.
LINK_LEASE_MS = 2000

_LINKS = ("1-4", "5-7")
ON_THE_SECOND_LINK = (Priority.DATA, Priority.DATA_LOW, Priority.BACKGROUND)
# A key without an owner.
_PROBE_KEY = "robomesh/-/-/-"
_SETTLE_S = 0.25
# A bulk connection over a line of known rate buffers what the line carries in this time [s]: enough to fill
# a line with a round trip of 80 ms, and little enough that urgent messages do not wait long behind it.
_BUFFERED_S = 0.065
# The buffer size of Linux includes its bookkeeping for each packet.
_LEAST_BUFFER_BYTES = 16_384
# Linux's default limit (net.core.wmem_max). It cannot fill a faster line, which keeps the buffers that the
# system sizes automatically.
_MOST_BUFFER_BYTES = 212_992
# Buffer of a connection for requests, and of the router's end on the same machine. While the service reads
# slowly, a flood then waits at its sender and not in front of other callers' requests. By default Linux
# gives a loopback connection megabytes.
_LOCAL_BUFFER_BYTES = 32_768
# When a machine disappears, closing its connections blocks the closing thread for up to 10 s (Zenoh sets
# SO_LINGER). By default a process receives with two threads, so a cut line stopped a site's own services
# for that time. Here are more threads than can block together; a client has four connections. A router's
# thread also blocks while a connection accepts no data: a flood over that many sessions would block all.
# Threads that send compete for the cores with the receivers: on two cores, with four of them instead of one,
# joint states took half as long again to 64 monitors.
_SENDING = max(1, min(4, (os.cpu_count() or 1) // 2))
_THREADS = {
    "router": f"(rx: (worker_threads: 64), tx: (worker_threads: {_SENDING}), net: (worker_threads: 4), "
    "acc: (worker_threads: 2))",
    "client": "(rx: (worker_threads: 6), tx: (worker_threads: 2), net: (worker_threads: 4))",
}


@dataclass(frozen=True, kw_only=True)
class Tls:
    """Certificates of one end of a mutual TLS link (PEM files; one file may hold them all).

    Attributes:
        any_address: Do not compare a router's address with its certificate. The certificates of `robomesh
            keys` name no address; they let only routers act as servers.
    """

    ca: Path
    certificate: Path
    key: Path
    any_address: bool = False


def bundle(file: Path, authority: Path | None = None) -> Tls:
    """Return the certificates of this end from one file of `robomesh keys`."""
    return Tls(ca=authority or file, certificate=file, key=file, any_address=True)


@dataclass(frozen=True, kw_only=True)
class Link:
    """Another router to link to.

    Attributes:
        tls: Certificates for this link; None: those of our router.
        site: The other site, whose authority signed the certificates.
    """

    endpoint: str
    tls: Tls | None = None
    site: str = ""


def client_config(
    routers: tuple[str, ...], tls: Tls | None = None, *, small_buffers: bool = False
) -> zenoh.Config:
    """Return the configuration of a client that connects to the first router that answers.

    Joint states and requests travel on one link of the session, video and other bulk on another. On a slow
    network joint states then take 10 ms; on one shared link they took 350 ms.

    Args:
        small_buffers: Limit the buffers of the connections, so that a fast sender is slowed down early.

    Raises:
        SessionError: If Zenoh rejects an endpoint.
    """
    buffer_bytes = _LOCAL_BUFFER_BYTES if small_buffers else None
    return _config(
        {
            "mode": "client",
            "connect/endpoints": [
                _two_links(router, buffer_bytes=(buffer_bytes, buffer_bytes)) for router in routers
            ],
            # Clients must reconnect to a restarted router before a lease expires.
            "connect/retry": {"period_init_ms": 50, "period_max_ms": 200, "period_increase_factor": 1.5},
            **_shared(tls),
        }
    )


def router_config(
    listen: tuple[str, ...],
    connect: tuple[str | Link, ...] = (),
    tls: Tls | None = None,
    access: Mapping[str, Any] = MappingProxyType({}),
    line_bps: float | None = None,
    *,
    may_come_late: bool = False,
) -> zenoh.Config:
    """Return the configuration of a router that listens and links to other sites' routers.

    Args:
        access: Sections of Zenoh's configuration with the access rules (`access_rights.py`).
        line_bps: Rate of the lines to other sites [bit/s]; None: unknown.
        may_come_late: Open although it cannot listen on an address, and try that again.

    Raises:
        SessionError: If Zenoh rejects an endpoint.
    """
    late = {"listen/exit_on_failure": False, "listen/timeout_ms": -1} if may_come_late else {}
    return _config(router_values(listen, connect, tls, access, line_bps) | late)


def router_values(
    listen: tuple[str, ...],
    connect: tuple[str | Link, ...] = (),
    tls: Tls | None = None,
    access: Mapping[str, Any] = MappingProxyType({}),
    line_bps: float | None = None,
) -> dict[str, Any]:
    """Return the values of `router_config` by their keys in Zenoh's configuration."""
    buffer_bytes = None if line_bps is None else max(round(line_bps / 8 * _BUFFERED_S), _LEAST_BUFFER_BYTES)
    if buffer_bytes is not None and buffer_bytes > _MOST_BUFFER_BYTES:
        buffer_bytes = None
    return {
        "mode": "router",
        "listen/endpoints": [_listener(each) for each in listen],
        "connect/endpoints": [
            _two_links(each, buffer_bytes=(None, buffer_bytes))
            if isinstance(each, str)
            else _two_links(each.endpoint, each.tls, buffer_bytes=(None, buffer_bytes))
            for each in connect
        ],
        # Scouting is off; by default the router would still wait half a second for it.
        "scouting/delay": 1,
        # Another site may be offline for days; this site starts without it.
        "connect/exit_on_failure": False,
        "connect/timeout_ms": -1,
        # `period_max_ms` is the longest wait after a line is repaired; `open_timeout` ends a hanging attempt.
        "connect/retry": {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 1.5},
        **_shared(tls),
        **access,
    }


def wait_until_declared(session: zenoh.Session, priority: Priority) -> None:
    """Wait until the router has received all declarations, if messages of this priority could overtake them.

    Declarations travel on the session's first link, and Zenoh shortens keys to numbers that they declare. A
    message on the second link that arrives before its declaration is silently dropped (a fifth of the first
    puts and gets on a busy machine). Returns immediately without a router.
    """
    if priority in ON_THE_SECOND_LINK:
        for _ in session.get(
            _PROBE_KEY,
            priority=zenoh.Priority.REAL_TIME,
            congestion_control=zenoh.CongestionControl.DROP,
            timeout=_SETTLE_S,
        ):
            pass


def timed_out(reply: zenoh.Reply) -> bool:
    """Return whether a reply stands for a queryable that did not answer in time."""
    return reply.err is not None and reply.err.payload.to_bytes() == b"Timeout"


def _listener(endpoint: str) -> str:
    """Return an endpoint to listen on, with small send buffers unless it sets its own."""
    address, _, options = endpoint.partition("#")
    if "so_sndbuf" in options:
        return endpoint
    is_local = "/127." in address or "/[::1]" in address or "/localhost" in address
    size = f"so_sndbuf={_LOCAL_BUFFER_BYTES if is_local else _MOST_BUFFER_BYTES}"
    return f"{address}#{options};{size}" if options else f"{address}#{size}"


def _two_links(
    endpoint: str, tls: Tls | None = None, buffer_bytes: tuple[int | None, int | None] = (None, None)
) -> dict[str, Any]:
    """Return both links to a router; certificates for this router only are options of the endpoint.

    Args:
        buffer_bytes: Size of each link's send and receive buffers; None: the system's choice.
    """
    address, _, own = endpoint.partition("#")
    separator = "&" if "?" in address else "?"
    options = [own] if own else []
    if tls is not None:
        options += [
            f"root_ca_certificate_file={tls.ca}",
            f"connect_certificate_file={tls.certificate}",
            f"connect_private_key_file={tls.key}",
        ]
    # The receive buffer sets the window that the other end may send.
    locators = []
    for priorities, size in zip(_LINKS, buffer_bytes, strict=True):
        sizes = [] if size is None else [f"so_sndbuf={size}", f"so_rcvbuf={size}"]
        tail = "#" + ";".join(options + sizes) if options + sizes else ""
        locators.append(f"{address}{separator}prio={priorities}{tail}")
    return {"strategy": "allOf", "locators": locators}


def _shared(tls: Tls | None) -> dict[str, Any]:
    values: dict[str, Any] = {
        "scouting/multicast/enabled": False,
        "transport/unicast/max_links": 4,
        # Limits the wait for a listener that is not a router; the default is 10 s a link.
        "transport/unicast/open_timeout": 3000,
        "transport/link/tx/lease": LINK_LEASE_MS,
        # No gain at the message sizes of this mesh, and not available in containers.
        "transport/shared_memory/enabled": False,
    }
    if tls is not None:
        values |= {
            "transport/link/tls/root_ca_certificate": str(tls.ca),
            "transport/link/tls/enable_mtls": True,
            "transport/link/tls/listen_certificate": str(tls.certificate),
            "transport/link/tls/listen_private_key": str(tls.key),
            "transport/link/tls/connect_certificate": str(tls.certificate),
            "transport/link/tls/connect_private_key": str(tls.key),
            "transport/link/tls/verify_name_on_connect": not tls.any_address,
            # An open connection must not outlive its certificate.
            "transport/link/tls/close_link_on_expiration": True,
        }
    return values


def _config(values: dict[str, Any]) -> zenoh.Config:
    # Zenoh reads it once, at a process's first session. Keep the user's value, but not one that our parent
    # process set for itself.
    if os.environ.get("ZENOH_RUNTIME") in (None, *_THREADS.values()):
        os.environ["ZENOH_RUNTIME"] = _THREADS[values["mode"]]
    config = zenoh.Config()
    for key, value in values.items():
        try:
            config.insert_json5(key, json.dumps(value))
        except zenoh.ZError as error:
            if key.endswith("/endpoints"):
                given = ", ".join(_endpoint(each) for each in value) or "nothing"
                raise SessionError(f"{given!r} is not an endpoint: one is tcp/127.0.0.1:7447") from None
            raise SessionError(f"Zenoh rejects {key} = {json.dumps(value)}: {first_line(error)}") from None
    return config


def _endpoint(value: str | dict[str, Any]) -> str:
    if isinstance(value, str):
        return value.partition("#")[0]
    return str(value["locators"][0]).removesuffix(f"?prio={_LINKS[0]}")


def first_line(error: Exception) -> str:
    """Return a Zenoh error's text without the position in Zenoh's source."""
    text = (str(error).splitlines() or [type(error).__name__])[0]
    return text.split(" at /", 1)[0].split(" at zenoh", 1)[0].strip()
