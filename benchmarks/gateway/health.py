"""The CPU cost of a gateway's health reports and Prometheus scrapes, for many robots.

    ./dev run python -m benchmarks health [--robots 100] [--json]

CPU time of this process alone, over a real router: publishers and queryables as a gateway declares them.
The gateway reports its health every 2 s, Prometheus scrapes every 5 s (docs/monitoring.md); a gateway of
100 robots at 100 Hz uses 0.57 of a core (gateway). Target: less than 2 % of that.
"""

import time
from collections.abc import Callable

import zenoh
from prometheus_client import CollectorRegistry, generate_latest

from robomesh.contract.endpoints import router_config
from robomesh.requests.server import Request
from robomesh.schemas.robomesh_pb2 import LeaseAnswer
from robomesh.service.health import Served, health_of
from robomesh.service.metrics import SessionMetrics
from robomesh.wire.session import Session, SessionSettings, open_session
from tests.ports import free_port

_TOPICS = ("joints", "joints/slow", "controller", "raw", "lease", "events", "audit", "program")
_REQUESTS = ("lease/request/*", "command/*", "audit/find")
_MEASURES = 8
_HEALTH_EACH_S, _SCRAPE_EACH_S = 2.0, 5.0
_OF_GATEWAY = 0.57


async def measure(robots: int = 100) -> dict[str, float]:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    names = [f"r{number}" for number in range(robots)]
    with zenoh.open(router_config((endpoint,))):
        async with open_session(SessionSettings(connect=(endpoint,))) as session:
            declare(session, names)
            served = Served(service="gateway", present_for=tuple(("s", name) for name in names))
            look = health_of(session, served)
            registry = CollectorRegistry()
            registry.register(SessionMetrics(session, {}))
            health_ms = cpu_ms(lambda: look().SerializeToString())
            scrape_ms = cpu_ms(lambda: generate_latest(registry))
            return {
                "robots": robots,
                "health_ms": health_ms,
                "bytes": len(look().SerializeToString()),
                "scrape_ms": scrape_ms,
                "scrape_bytes": len(generate_latest(registry)),
                "share": (health_ms / _HEALTH_EACH_S + scrape_ms / _SCRAPE_EACH_S) / 1000 / _OF_GATEWAY,
            }


def declare(session: Session, names: list[str]) -> None:
    """Declare the publishers and queryables of a gateway for its robots."""

    async def answer(request: Request) -> LeaseAnswer:
        return LeaseAnswer()

    for name in names:
        for topic in _TOPICS:
            session.declare_publisher("s", name, topic)
        for request in _REQUESTS:
            session.answer("s", name, request, answer)
    for number in range(_MEASURES):
        session.measure(
            f"number_{number}_total", "a number for each robot", lambda: dict.fromkeys(names, 1.0)
        )


def cpu_ms(work: Callable[[], object], times: int = 50) -> float:
    began = time.process_time()
    for _ in range(times):
        work()
    return (time.process_time() - began) / times * 1000
