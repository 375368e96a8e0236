"""Zenoh configurations: a client of a router, and a router."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import zenoh

from bus.errors import SessionError
from bus.topics import Priority

DEFAULT_ROUTER = "tcp/127.0.0.1:7447"

_LINKS = ("1-4", "5-7")
ON_THE_SECOND_LINK = (Priority.DATA, Priority.DATA_LOW, Priority.BACKGROUND)
_NOBODYS_KEY = "robomesh/-/-/-"
_SETTLE_S = 0.25


@dataclass(frozen=True, kw_only=True)
class Tls:
    """Certificates of one end of a mutual TLS link (PEM files)."""

    ca: Path
    certificate: Path
    key: Path


def client_config(routers: tuple[str, ...], tls: Tls | None = None) -> zenoh.Config:
    """The configuration of a client of the first router that answers.

    Joint states and requests travel on one link of the session, video and other bulk on another:
    on a slow network that keeps the former at 10 ms where one shared link took 350 ms.

    Raises:
        SessionError: If an endpoint is not one of Zenoh's.
    """
    return _config(
        {
            "mode": "client",
            "connect/endpoints": [_two_links(router) for router in routers],
            "connect/retry": {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 1.5},
            **_shared(tls),
        }
    )


def router_config(
    listen: tuple[str, ...], connect: tuple[str, ...] = (), tls: Tls | None = None
) -> zenoh.Config:
    """The configuration of a router that listens, and links to other sites' routers.

    Raises:
        SessionError: If an endpoint is not one of Zenoh's.
    """
    return _config(
        {
            "mode": "router",
            "listen/endpoints": list(listen),
            "connect/endpoints": [_two_links(router) for router in connect],
            # Nobody is scouted for; the default waits half a second for nobody.
            "scouting/delay": 1,
            # Another site may be away for days: this site starts without it.
            "connect/exit_on_failure": False,
            "connect/timeout_ms": -1,
            "connect/retry": {"period_init_ms": 200, "period_max_ms": 4000, "period_increase_factor": 1.5},
            **_shared(tls),
        }
    )


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


def _two_links(endpoint: str) -> dict[str, Any]:
    separator = "&" if "?" in endpoint else "?"
    return {"strategy": "allOf", "locators": [f"{endpoint}{separator}prio={p}" for p in _LINKS]}


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
        }
    return values


def _config(values: dict[str, Any]) -> zenoh.Config:
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
    return value if isinstance(value, str) else str(value["locators"][0]).removesuffix(f"?prio={_LINKS[0]}")


def first_line(error: Exception) -> str:
    """A Zenoh error without the place in its source."""
    text = (str(error).splitlines() or [type(error).__name__])[0]
    return text.split(" at /", 1)[0].split(" at zenoh", 1)[0].strip()
