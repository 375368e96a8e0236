"""Presence, health, clock and metrics of a process of the mesh."""

import asyncio
import functools
import logging
import os
import socket
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import TypeVar

import psutil

from robomesh import reason_codes as codes
from robomesh.contract.keys import WHOLE_SITE
from robomesh.contract.messages import reason_message
from robomesh.publications.publisher import Publisher
from robomesh.schemas.robomesh_pb2 import ServiceHealth
from robomesh.service.clock import answer_clock
from robomesh.service.loop_turns import MeasuredLoop
from robomesh.wire.session import Session

log = logging.getLogger(__name__)

_Listener = TypeVar("_Listener")
_LISTEN_AGAIN_S = 5.0


@dataclass(frozen=True, kw_only=True)
class Served:
    """The service that a process runs, and the robots that it serves.

    Attributes:
        service: Name in keys.
        present_for: The (site, robot) pairs that it serves, of one site; `-` as the robot for the whole site.
        metrics: Host and port of the Prometheus endpoint; None: no endpoint.
    """

    service: str
    present_for: tuple[tuple[str, str], ...]
    metrics: tuple[str, int] | None = None


@asynccontextmanager
async def present(
    session: Session, served: Served, *, zenoh_id: Callable[[], str] | None = None
) -> AsyncIterator[None]:
    """Announce the process while the block runs: presence, health, clock, metrics.

    Args:
        zenoh_id: Returns the Zenoh id to report; a router's process reports its router. By default the
            session's id.
    """
    health = _Health(session, served, zenoh_id)
    if isinstance(loop := asyncio.get_running_loop(), MeasuredLoop):
        turns = loop.turns
        session.measure("longest_turn_seconds", "Longest turn of the event loop, lately", turns.longest_s)
        session.measure("long_turns_total", "Turns of the event loop above 50 ms", lambda: turns.long_turns)
    tasks = []
    if served.metrics is not None:
        tasks.append(asyncio.create_task(_serve_metrics(session, *served.metrics, health.about)))
    for site, robot in served.present_for:
        session.declare_presence(site, robot, served.service)
    sites = {site for site, _ in served.present_for}
    for site in sites:
        answer_clock(session, site)
    tasks += [asyncio.create_task(health.publish(site)) for site in sites]
    try:
        yield
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def listen_when_possible(
    session: Session, what: str, host: str, port: int, listen: Callable[[], Awaitable[_Listener]]
) -> _Listener:
    """Listen on an address that the service can do without; return what `listen` returns.

    While it cannot, the process's health says so.

    Args:
        what: For the text: "metrics".
        listen: Listens; raises an OSError if it cannot.
    """
    while True:
        try:
            listener = await listen()
        except OSError as error:
            detail = os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)
            problem = codes.CANNOT_LISTEN(what=what, address=f"{host}:{port}", detail=detail)
            if session.problems.get(what) != problem:
                log.warning("%s", problem)
            session.problems[what] = problem
            await asyncio.sleep(_LISTEN_AGAIN_S)
        else:
            session.problems.pop(what, None)
            return listener


async def _serve_metrics(session: Session, host: str, port: int, about: Mapping[str, str]) -> None:
    from robomesh.service.metrics import serve_metrics  # Prometheus's client takes 0.1 s to import

    async def serve() -> str:
        return serve_metrics(session, host, port, about)

    log.info("metrics %s", await listen_when_possible(session, "metrics", host, port, serve))


def health_of(session: Session, served: Served) -> Callable[[], ServiceHealth]:
    """Return a function that measures this process at each call."""
    return _Health(session, served, None).measure


@functools.cache
def own_version() -> str:
    """Return the installed version of robomesh."""
    try:
        return version("robomesh")
    except PackageNotFoundError:
        return "unknown"


class _Health:
    """The health of this process."""

    def __init__(self, session: Session, served: Served, zenoh_id: Callable[[], str] | None) -> None:
        self._session, self._served = session, served
        self._zenoh_id = zenoh_id or (lambda: str(session.zenoh_session.info.zid()))
        self._process = psutil.Process()
        self._host = socket.gethostname()
        self._last_cpu = (time.monotonic(), 0.0)

    @property
    def about(self) -> dict[str, str]:
        """Labels that identify this process."""
        return {
            "service": self._served.service,
            "site": ",".join(sorted({site for site, _ in self._served.present_for})),
            "id": self._session.identity,
            "version": own_version(),
            "host": self._host,
        }

    async def publish(self, site: str) -> None:
        """Publish the health at the topic's heartbeat until cancelled."""
        topic = f"health/{self._served.service}.{self._session.identity}"
        publisher = self._session.declare_publisher(site, WHOLE_SITE, topic)
        while True:
            self._put(publisher)
            await asyncio.sleep(publisher.topic.heartbeat_s or 2.0)

    def _put(self, publisher: Publisher) -> None:
        try:
            publisher.put(self.measure())
        except Exception:  # a failed measurement must not end the service
            log.exception("cannot measure this process's health")

    def measure(self) -> ServiceHealth:
        """Measure this process now; CPU since the last call."""
        with self._process.oneshot():
            times, memory = self._process.cpu_times(), self._process.memory_info()
            started_s = self._process.create_time()
            open_files = self._process.num_fds()
        now_s, used_s = time.monotonic(), times.user + times.system
        before_s, used_before_s = self._last_cpu
        self._last_cpu = now_s, used_s
        counters = self._session.counters()
        health = ServiceHealth(
            service=self._served.service,
            id=self._session.identity,
            version=own_version(),
            host=self._host,
            pid=self._process.pid,
            cpu=(used_s - used_before_s) / max(now_s - before_s, 1e-3) if used_before_s else 0.0,
            memory_bytes=memory.rss,
            open_files=open_files,
            published=counters.published.total(),
            received=counters.received.total(),
            lost=counters.lost.total(),
            turned_away=counters.turned_away.total(),
            robots=sorted({robot for _, robot in self._served.present_for} - {WHOLE_SITE}),
            zenoh_id=self._zenoh_id(),
            ignored=self._session.ignored.count,
            ignored_examples=tuple(self._session.ignored.examples),
            problems=map(reason_message, self._session.problems.values()),
        )
        health.timestamp.GetCurrentTime()
        health.started.FromNanoseconds(round(started_s * 1e9))
        for measure in self._session.measures:
            value = measure.read()
            if isinstance(value, float | int):  # values by robot are in the robot's topics and the metrics
                health.values[measure.name] = value
        return health
