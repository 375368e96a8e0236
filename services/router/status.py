"""A router's presence, health and events, published for its site."""

import asyncio
import logging
from collections.abc import Callable

import zenoh

from robomesh.contract.keys import WHOLE_SITE
from robomesh.errors import RobomeshError
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.service.health import Served, present
from robomesh.wire.session import SessionSettings, open_session

log = logging.getLogger(__name__)

SERVICE = "router"
Severity = schema.Event.Severity
_LEVEL = {
    schema.Event.INFO: logging.INFO,
    schema.Event.WARNING: logging.WARNING,
    schema.Event.ERROR: logging.ERROR,
}
_MAX_QUEUED = 100


class StatusPublisher:
    """Queues the router's events, and publishes them over a session.

    A router is not a client of itself; this session reconnects to it like every other client.
    """

    def __init__(self) -> None:
        # Addresses that it cannot listen on yet.
        self.problems: dict[str, Reason] = {}
        self._queue: asyncio.Queue[schema.Event] = asyncio.Queue(_MAX_QUEUED)

    def publish_event(self, severity: Severity, code: str, text: str) -> None:
        """Queue an event of the router's site, and log it."""
        log.log(_LEVEL.get(severity, logging.ERROR), "%s", text)
        event = schema.Event(severity=severity, code=f"router.{code}", text=text, source=SERVICE)
        event.timestamp.GetCurrentTime()
        if not self._queue.full():
            self._queue.put_nowait(event)

    async def run(
        self,
        site: str,
        mesh: SessionSettings,
        *,
        metrics: tuple[str, int] | None,
        router: Callable[[], zenoh.Session],
        links: int,
    ) -> None:
        """Declare presence and publish events until cancelled.

        Args:
            router: Returns the current session; it is reopened when the rules change.
            links: Number of configured links.
        """

        def zenoh_id() -> str:
            return str(router().info.zid())

        served = Served(service=SERVICE, present_for=((site, WHOLE_SITE),), metrics=metrics)
        try:
            async with open_session(mesh) as session, present(session, served, zenoh_id=zenoh_id):
                session.problems = self.problems
                session.measure("links", "Other routers that it reaches", lambda: _links(router()))
                session.measure("links_wanted", "Routers that it is to link to", lambda: links)
                publisher = session.declare_publisher(site, WHOLE_SITE, f"events/{SERVICE}")
                while True:
                    publisher.put(await self._queue.get())
        except RobomeshError as error:
            log.error("the router cannot publish its status: %s", error)


def _links(router: zenoh.Session) -> int:
    try:
        return len(router.info.routers_zid())
    except zenoh.ZError:  # it is being reopened
        return 0
