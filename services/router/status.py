"""What a router tells of itself: that it is there, and what it sees, as events of its site."""

import asyncio
import logging
from collections.abc import Callable

import zenoh

from robomesh.errors import BusError
from robomesh.health import Served, present
from robomesh.keys import WHOLE_SITE
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import SessionSettings, open_session

log = logging.getLogger(__name__)

SERVICE = "router"
Severity = schema.Event.Severity
_LEVEL = {
    schema.Event.INFO: logging.INFO,
    schema.Event.WARNING: logging.WARNING,
    schema.Event.ERROR: logging.ERROR,
}
_MOST_WAITING = 100


class Telling:
    """Takes what the router has to say, and says it over a session of its own.

    A router is nobody's client; this session comes back to it as every client does.
    """

    def __init__(self) -> None:
        self._waiting: asyncio.Queue[schema.Event] = asyncio.Queue(_MOST_WAITING)

    def say(self, severity: Severity, code: str, text: str) -> None:
        """An event of the router's site, and a line of its log."""
        log.log(_LEVEL.get(severity, logging.ERROR), "%s", text)
        event = schema.Event(severity=severity, code=f"router.{code}", text=text, source=SERVICE)
        event.timestamp.GetCurrentTime()
        if not self._waiting.full():
            self._waiting.put_nowait(event)

    async def tell(
        self,
        site: str,
        mesh: SessionSettings,
        *,
        metrics: tuple[str, int] | None,
        router: Callable[[], zenoh.Session],
        links: int,
    ) -> None:
        """Be present for the site, as every service is, until cancelled.

        Args:
            router: As it is now: it is opened anew when its rules change.
            links: How many other routers it is to link to.
        """

        def zenoh_id() -> str:
            return str(router().info.zid())

        served = Served(service=SERVICE, present_for=((site, WHOLE_SITE),), metrics=metrics)
        try:
            async with open_session(mesh) as session, present(session, served, zenoh_id=zenoh_id):
                session.measure("links", "Other routers that it reaches", lambda: _links(router()))
                session.measure("links_wanted", "Routers that it is to link to", lambda: links)
                publisher = session.declare_publisher(site, WHOLE_SITE, f"events/{SERVICE}")
                while True:
                    publisher.put(await self._waiting.get())
        except BusError as error:
            log.error("the router cannot tell of itself: %s", error)


def _links(router: zenoh.Session) -> int:
    try:
        return len(router.info.routers_zid())
    except zenoh.ZError:  # it is just being opened anew
        return 0
