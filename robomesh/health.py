"""What every process of the mesh tells of itself: that it is there, how it is, and what its clock says."""

import asyncio
import functools
import logging
import socket
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

import psutil

from robomesh.clock import answer_clock
from robomesh.keys import WHOLE_SITE
from robomesh.publisher import Publisher
from robomesh.schemas.robomesh_pb2 import ServiceHealth
from robomesh.session import Session

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Served:
    """Which service a process is, and for whom.

    Attributes:
        service: Its name in keys.
        present_for: The (site, robot) pairs that it serves, of one site; `-` as the robot for the whole site.
        metrics: Host and port at which Prometheus may ask; None: nowhere.
    """

    service: str
    present_for: tuple[tuple[str, str], ...]
    metrics: tuple[str, int] | None = None


@asynccontextmanager
async def present(
    session: Session, served: Served, *, zenoh_id: Callable[[], str] | None = None
) -> AsyncIterator[None]:
    """Be there for everybody while the block runs: presence, health, clock, metrics.

    Args:
        zenoh_id: Tells the router's, where a router's own session tells of it; else it is the session's.

    Raises:
        SessionError: If the metrics cannot be served where they should be.
    """
    health = _Health(session, served, zenoh_id)
    if served.metrics is not None:
        from robomesh.metrics import serve_metrics  # Prometheus's client takes 0.1 s to import

        log.info("metrics %s", serve_metrics(session, *served.metrics, health.about))
    for site, robot in served.present_for:
        session.declare_presence(site, robot, served.service)
    sites = {site for site, _ in served.present_for}
    for site in sites:
        answer_clock(session, site)
    telling = [asyncio.create_task(health.tell(site)) for site in sites]
    try:
        yield
    finally:
        for task in telling:
            task.cancel()
        await asyncio.gather(*telling, return_exceptions=True)


def health_of(session: Session, served: Served) -> Callable[[], ServiceHealth]:
    """Looks at this process, each time it is called."""
    return _Health(session, served, None).look


@functools.cache
def own_version() -> str:
    """Of robomesh, as it is installed."""
    try:
        return version("robomesh")
    except PackageNotFoundError:
        return "unknown"


class _Health:
    """Looks at its own process."""

    def __init__(self, session: Session, served: Served, zenoh_id: Callable[[], str] | None) -> None:
        self._session, self._served = session, served
        self._zenoh_id = zenoh_id or (lambda: str(session.zenoh_session.info.zid()))
        self._process = psutil.Process()
        self._host = socket.gethostname()
        self._looked = (time.monotonic(), 0.0)

    @property
    def about(self) -> dict[str, str]:
        """Which process this is."""
        return {
            "service": self._served.service,
            "site": ",".join(sorted({site for site, _ in self._served.present_for})),
            "id": self._session.identity,
            "version": own_version(),
            "host": self._host,
        }

    async def tell(self, site: str) -> None:
        """Publish it again and again."""
        topic = f"health/{self._served.service}.{self._session.identity}"
        publisher = self._session.declare_publisher(site, WHOLE_SITE, topic)
        while True:
            self._put(publisher)
            await asyncio.sleep(publisher.topic.heartbeat_s or 2.0)

    def _put(self, publisher: Publisher) -> None:
        try:
            publisher.put(self.look())
        except Exception:  # a service is not ended by its looking glass
            log.exception("this process cannot be looked at")

    def look(self) -> ServiceHealth:
        """How this process is now; CPU since the last look."""
        with self._process.oneshot():
            times, memory = self._process.cpu_times(), self._process.memory_info()
            started_s = self._process.create_time()
            open_files = self._process.num_fds()
        now_s, used_s = time.monotonic(), times.user + times.system
        before_s, used_before_s = self._looked
        self._looked = now_s, used_s
        tally = self._session.tally()
        health = ServiceHealth(
            service=self._served.service,
            id=self._session.identity,
            version=own_version(),
            host=self._host,
            pid=self._process.pid,
            cpu=(used_s - used_before_s) / max(now_s - before_s, 1e-3) if used_before_s else 0.0,
            memory_bytes=memory.rss,
            open_files=open_files,
            published=tally.published.total(),
            received=tally.received.total(),
            lost=tally.lost.total(),
            turned_away=tally.turned_away.total(),
            robots=sorted({robot for _, robot in self._served.present_for} - {WHOLE_SITE}),
            zenoh_id=self._zenoh_id(),
            ignored=self._session.ignored.count,
            ignored_examples=tuple(self._session.ignored.examples),
        )
        health.timestamp.GetCurrentTime()
        health.started.FromNanoseconds(round(started_s * 1e9))
        for measure in self._session.measures:
            value = measure.read()
            if isinstance(value, float | int):  # of each robot: its topics tell, and the metrics
                health.values[measure.name] = value
        return health
