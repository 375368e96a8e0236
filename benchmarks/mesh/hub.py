"""The cost of a hub as the mesh grows: many sites' routers with many robots' keys each, and a new client.

    ./dev run python -m benchmarks hub [--sites 5,10,20] [--robots 50] [--json]

Each site is a router with one client that declares the keys of a robot's services: a publisher and a
queryable for each topic of the table, a queryable for each request, four tokens of presence. The sites
share a process, because a process each would cost more than the sites do; the hub has a separate process.
No state is sent. Results: the hub's memory; the processor time of the hub and of all sites' routers and
clients; the bytes on this machine's loopback until the hub knew all keys; the time until a new client at the
hub has all presence tokens, and every robot's answer to one get; and the cost of one more site.
"""

import contextlib
import os
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection
from typing import Annotated, Any

import psutil
import zenoh
from typer import Option

from benchmarks.harness.processes import cpu_s, piped, process, rss_mib, until, until_connectable
from robomesh.contract.endpoints import client_config, router_config
from robomesh.contract.topics import REQUESTS, TOPICS
from tests.ports import free_port

SERVICES = ("gateway", "kinematics", "renderer", "recorder")


def measure(
    sites: str = "5,10,20", robots: Annotated[int, Option(help="of each site")] = 50
) -> Iterator[dict[str, Any]]:
    for count in sites.split(","):
        yield of_hub(int(count), robots)


def of_hub(sites: int, robots: int) -> dict[str, Any]:
    """Measure one hub with a number of sites."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with process(route, endpoint) as hub, contextlib.ExitStack() as stack:
        until_connectable(endpoint)
        ours = stack.enter_context(piped(serve_plants, robots, endpoint))
        plants = ours.recv()
        empty, carried = rss_mib(hub.pid), loopback()
        used = {pid: cpu_s(pid) for pid in (hub.pid, plants)}
        with zenoh.open(client_config((endpoint,))) as watching, Present(watching) as present:
            begun = time.monotonic()
            ours.send(sites)
            present.until(sites * robots * len(SERVICES))
            known_s = time.monotonic() - begun
        time.sleep(2.0)  # declarations that arrive after the presence tokens
        row = {
            "sites": sites,
            "robots": sites * robots,
            "declarations": sites * robots * (2 * len(topics()) + len(requests()) + len(SERVICES)),
            "empty_mib": empty,
            "hub_mib": rss_mib(hub.pid),
            "carried_mb": (loopback() - carried) / 1e6,
            "known_s": known_s,
            "hub_cpu_s": cpu_s(hub.pid) - used[hub.pid],
            "sites_cpu_s": cpu_s(plants) - used[plants],
        }
        begun = time.monotonic()
        with zenoh.open(client_config((endpoint,))) as joining, Present(joining) as present:
            present.until(sites * robots * len(SERVICES))
            row["joined_s"] = time.monotonic() - begun
            begun = time.monotonic()
            answers = sum(reply.ok is not None for reply in joining.get("robomesh/*/*/joints", timeout=30.0))
            row["answers_s"], row["answers"] = time.monotonic() - begun, answers
            begun, carried = time.monotonic(), loopback()
            ours.send(1)
            present.until((sites + 1) * robots * len(SERVICES))
            row["more_s"] = time.monotonic() - begun
            time.sleep(1.0)
            row["more_kb"] = (loopback() - carried) / 1e3
        return row


class Present:
    """The presence tokens that a session knows."""

    def __init__(self, session: zenoh.Session) -> None:
        self._keys: set[str] = set()
        self._subscriber = session.liveliness().declare_subscriber(
            "robomesh/*/*/alive/*/*", lambda sample: self._keys.add(str(sample.key_expr)), history=True
        )

    def __enter__(self) -> "Present":
        return self

    def __exit__(self, *_: object) -> None:
        self._subscriber.undeclare()

    def until(self, count: int) -> None:
        """Wait until that number of tokens is known."""
        until(lambda: len(self._keys) >= count, within_s=120.0, each_s=0.01)


def topics() -> list[str]:
    """Return the keys of a robot's topics, with four views."""
    found = [name for name in TOPICS if not name.endswith("/*")]
    return found + [
        f"{kind}/{view}" for kind in ("video", "image") for view in ("front", "top", "left", "free")
    ]


def requests() -> list[str]:
    return list(REQUESTS)


def route(endpoint: str) -> None:
    with zenoh.open(router_config((endpoint,))):
        time.sleep(3600)


def serve_plants(robots: int, hub: str, told: Connection) -> None:
    """Start as many more sites as each request asks for."""
    with contextlib.ExitStack() as stack:
        kept: list[Any] = []
        number = 0
        told.send(os.getpid())
        while True:
            for _ in range(told.recv()):
                kept += start(stack, number, robots, hub)
                number += 1


def start(stack: contextlib.ExitStack, number: int, robots: int, hub: str) -> list[Any]:
    """Start a site: its router, and a client that declares the services of all its robots."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    stack.enter_context(zenoh.open(router_config((endpoint,), (hub,))))
    session = stack.enter_context(zenoh.open(client_config((endpoint,))))
    kept: list[Any] = []
    for robot in range(robots):
        base = f"robomesh/site-{number}/arm-{robot}"
        for name in topics():
            kept.append(session.declare_publisher(f"{base}/{name}"))
            kept.append(session.declare_queryable(f"{base}/{name}", answering(f"{base}/{name}")))
        kept += [session.declare_queryable(f"{base}/{name}", refusing) for name in requests()]
        for service in SERVICES:
            kept.append(session.liveliness().declare_token(f"{base}/alive/{service}/0a0b0c0d"))
    return kept


def answering(key: str) -> Any:
    return lambda query: query.reply(key, b"")


def refusing(query: zenoh.Query) -> None:
    query.reply_err(b"")


def loopback() -> int:
    """Return how many bytes the loopback interface has carried."""
    return int(psutil.net_io_counters(pernic=True)["lo"].bytes_sent)
