"""Zenoh configurations: a client of a router, and a router."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import zenoh

from robomesh.errors import SessionError
from robomesh.topics import Priority

DEFAULT_ROUTER = "tcp/127.0.0.1:7447"

_LINKS = ("1-4", "5-7")
ON_THE_SECOND_LINK = (Priority.DATA, Priority.DATA_LOW, Priority.BACKGROUND)
_NOBODYS_KEY = "robomesh/-/-/-"
_SETTLE_S = 0.25
# Of bulk, a connection over a line whose rate is told holds what the line carries in this long [s]: enough
# to fill it over 80 ms there and back, and so little that what is urgent never waits for much.
_HELD_S = 0.065
# Linux counts each packet's own bookkeeping too.
_LEAST_HELD_BYTES = 16_384
# What Linux grants by default (net.core.wmem_max): a line too quick to be kept busy by so little has the
# buffers that the system sizes by itself.
_MOST_HELD_BYTES = 212_992
# What a connection for requests, and the router's end of it on the same machine, hold: when the service reads
# slowly, a flood then waits at its sender and not in front of the requests of others. Linux by itself gives a
# connection on loopback megabytes.
_HELD_LOCALLY_BYTES = 32_768
# When a machine goes without a word, closing its connections holds the thread that does it for up to 10 s
# (Zenoh sets SO_LINGER), and by default a process receives with two: a cut line silenced a site's own
# services for as long. So there are more than can be held at once; a client has four connections. A router's
# thread also waits where a connection takes no more: a flood over as many sessions would hold all of them.
_THREADS = {
    "router": "(rx: (worker_threads: 64), tx: (worker_threads: 4), net: (worker_threads: 4), "
    "acc: (worker_threads: 2))",
    "client": "(rx: (worker_threads: 6), tx: (worker_threads: 2), net: (worker_threads: 4))",
}


@dataclass(frozen=True, kw_only=True)
class Tls:
    """Certificates of one end of a mutual TLS link (PEM files; one file may hold them all).

    Attributes:
        any_address: A router may have any address: its certificate says that it is one, not where. So do
            those of `robomesh keys`, where only routers may serve.
    """

    ca: Path
    certificate: Path
    key: Path
    any_address: bool = False


def bundle(file: Path, authority: Path | None = None) -> Tls:
    """What one file of `robomesh keys` holds, as certificates of this end."""
    return Tls(ca=authority or file, certificate=file, key=file, any_address=True)


@dataclass(frozen=True, kw_only=True)
class Link:
    """Another router to link to, and the certificates for it; None: the router's own.

    Attributes:
        site: The other site, whose authority signed them.
    """

    endpoint: str
    tls: Tls | None = None
    site: str = ""


def client_config(
    routers: tuple[str, ...], tls: Tls | None = None, *, holds_little: bool = False
) -> zenoh.Config:
    """The configuration of a client of the first router that answers.

    Joint states and requests travel on one link of the session, video and other bulk on another:
    on a slow network that keeps the former at 10 ms where one shared link took 350 ms.

    Args:
        holds_little: Little waits on its connections: who sends more than it reads is held up.

    Raises:
        SessionError: If an endpoint is not one of Zenoh's.
    """
    held_bytes = _HELD_LOCALLY_BYTES if holds_little else None
    return _config(
        {
            "mode": "client",
            "connect/endpoints": [
                _two_links(router, held_bytes=(held_bytes, held_bytes)) for router in routers
            ],
            # A router's restart must be over before a lease ends: its clients wait no longer than this.
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
) -> zenoh.Config:
    """The configuration of a router that listens, and links to other sites' routers.

    Args:
        access: Sections of Zenoh's configuration that say who may do what (`robomesh/access.py`).
        line_bps: What the lines to the others carry [bit/s]; None: nobody knows.

    Raises:
        SessionError: If an endpoint is not one of Zenoh's.
    """
    return _config(router_values(listen, connect, tls, access, line_bps))


def router_values(
    listen: tuple[str, ...],
    connect: tuple[str | Link, ...] = (),
    tls: Tls | None = None,
    access: Mapping[str, Any] = MappingProxyType({}),
    line_bps: float | None = None,
) -> dict[str, Any]:
    """As `router_config`, as keys of Zenoh's configuration and their values."""
    held_bytes = None if line_bps is None else max(round(line_bps / 8 * _HELD_S), _LEAST_HELD_BYTES)
    if held_bytes is not None and held_bytes > _MOST_HELD_BYTES:
        held_bytes = None
    return {
        "mode": "router",
        "listen/endpoints": [_listener(each) for each in listen],
        "connect/endpoints": [
            _two_links(each, held_bytes=(None, held_bytes))
            if isinstance(each, str)
            else _two_links(each.endpoint, each.tls, held_bytes=(None, held_bytes))
            for each in connect
        ],
        # Nobody is scouted for; the default waits half a second for nobody.
        "scouting/delay": 1,
        # Another site may be away for days: this site starts without it.
        "connect/exit_on_failure": False,
        "connect/timeout_ms": -1,
        # The most that a healed line waits for; what hangs is given up after `open_timeout`.
        "connect/retry": {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 1.5},
        **_shared(tls),
        **access,
    }


def settle(session: zenoh.Session, priority: Priority) -> None:
    """Wait until the router knows what was declared, where what follows may overtake it.

    Declarations travel on the session's first link, and Zenoh shortens keys to numbers that they
    declare: what follows at once on the second link is dropped in silence when it comes first
    (a fifth of the first puts and gets on a busy machine). Returns at once without a router.
    """
    if priority in ON_THE_SECOND_LINK:
        for _ in session.get(
            _NOBODYS_KEY,
            priority=zenoh.Priority.REAL_TIME,
            congestion_control=zenoh.CongestionControl.DROP,
            timeout=_SETTLE_S,
        ):
            pass


def _listener(endpoint: str) -> str:
    """An endpoint to listen on, whose connections keep little that waits to be sent."""
    address, _, options = endpoint.partition("#")
    if "so_sndbuf" in options:
        return endpoint
    is_local = "/127." in address or "/[::1]" in address or "/localhost" in address
    sent = f"so_sndbuf={_HELD_LOCALLY_BYTES if is_local else _MOST_HELD_BYTES}"
    return f"{address}#{options};{sent}" if options else f"{address}#{sent}"


def _two_links(
    endpoint: str, tls: Tls | None = None, held_bytes: tuple[int | None, int | None] = (None, None)
) -> dict[str, Any]:
    """Both links to a router; certificates that are for it alone stand in the endpoint itself.

    Args:
        held_bytes: How much the buffers of each hold, either way; None: what the system likes.
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
    # Its own sending, and by the window that it offers the other end's.
    locators = []
    for priorities, held in zip(_LINKS, held_bytes, strict=True):
        short = [] if held is None else [f"so_sndbuf={held}", f"so_rcvbuf={held}"]
        tail = "#" + ";".join(options + short) if options + short else ""
        locators.append(f"{address}{separator}prio={priorities}{tail}")
    return {"strategy": "allOf", "locators": locators}


def _shared(tls: Tls | None) -> dict[str, Any]:
    values: dict[str, Any] = {
        "scouting/multicast/enabled": False,
        "transport/unicast/max_links": 4,
        # Something that listens and is no router is given up after this, not after 10 s a link.
        "transport/unicast/open_timeout": 3000,
        # A frozen host is noticed after 1.7 s instead of 10.
        "transport/link/tx/lease": 2000,
        # No gain at the sizes of this mesh, and not there in containers.
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
            # Who stays must not stay longer than the certificate says.
            "transport/link/tls/close_link_on_expiration": True,
        }
    return values


def _config(values: dict[str, Any]) -> zenoh.Config:
    # Read once, at a process's first session. Who set it knows better, unless it was a parent of ours.
    if os.environ.get("ZENOH_RUNTIME") in (None, *_THREADS.values()):
        os.environ["ZENOH_RUNTIME"] = _THREADS[values["mode"]]
    config = zenoh.Config()
    for key, value in values.items():
        try:
            config.insert_json5(key, json.dumps(value))
        except zenoh.ZError as error:
            if key.endswith("/endpoints"):
                given = ", ".join(_endpoint(each) for each in value) or "nothing"
                raise SessionError(f"{given!r} is no endpoint: tcp/127.0.0.1:7447 is one") from None
            raise SessionError(f"{key} = {json.dumps(value)} is not taken: {first_line(error)}") from None
    return config


def _endpoint(value: str | dict[str, Any]) -> str:
    if isinstance(value, str):
        return value.partition("#")[0]
    return str(value["locators"][0]).removesuffix(f"?prio={_LINKS[0]}")


def first_line(error: Exception) -> str:
    """A Zenoh error without the place in its source."""
    text = (str(error).splitlines() or [type(error).__name__])[0]
    return text.split(" at /", 1)[0].split(" at zenoh", 1)[0].strip()
