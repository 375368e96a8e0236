"""The link to one controller: keeps a connection, tells its state in words, hands over every event at once.

    DOWN --connected--> SILENT --unit--> UP
    UP --no unit for stale_after_s--> SILENT --none for reconnect_after_s--> DOWN
    any --connection lost--> DOWN --after a pause, 0.2 s growing to 5 s--> connect again

Data is dated once, when its last byte was read from the socket (or earlier, when it was held back on
the way: see `dating`), and never again.
"""

import asyncio
import logging
import random
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from protocol_gateway.connection import Connection, reason_of
from protocol_gateway.dating import Dating, Received
from protocol_gateway.driver import (
    ControllerEvent,
    Driver,
    JointsReceived,
    MalformedReceived,
    Refused,
    StatusReceived,
    UnknownReceived,
)
from protocol_gateway.errors import LinkDownError

__all__ = ["ControllerLink", "LinkCounters", "LinkSettings", "LinkState", "LinkStatus", "Received"]

logger = logging.getLogger(__name__)

_FIRST_PAUSE_S = 0.2
_LONGEST_PAUSE_S = 5.0


class LinkState(Enum):
    """State of the link, as in `robomesh.ControllerState.Link`."""

    DOWN = "down"
    UP = "up"
    SILENT = "silent"


@dataclass(frozen=True, kw_only=True)
class LinkSettings:
    """Where the controller is, and how patient the link.

    Attributes:
        stale_after_s: Without a unit for this long the link is SILENT.
        reconnect_after_s: Without a unit for this long the connection is given up and made anew.
        connect_timeout_s: For one attempt to connect.
    """

    host: str
    port: int
    stale_after_s: float = 1.0
    reconnect_after_s: float = 4.0
    connect_timeout_s: float = 3.0


@dataclass(frozen=True, slots=True)
class LinkStatus:
    """State of the link and, for people, why."""

    state: LinkState
    text: str


@dataclass(frozen=True, slots=True)
class LinkCounters:
    """Counts since the gateway's start, as in `robomesh.LinkCounters`."""

    units_received: int = 0
    units_malformed: int = 0
    units_sent: int = 0
    bytes_received: int = 0
    bytes_sent: int = 0
    records_unknown: int = 0
    connections: int = 0
    refusals: int = 0


class ControllerLink:
    """A link to one controller.

    `on_event` and `on_status` are called on the event loop, straight from the socket's callback:
    no queue, no task switch. They must return soon, and an exception of theirs ends `run`.
    """

    def __init__(
        self,
        settings: LinkSettings,
        driver: Driver,
        *,
        on_event: Callable[[ControllerEvent, Received], None],
        on_status: Callable[[LinkStatus], None] = lambda status: None,
        monotonic_s: Callable[[], float] = time.monotonic,
        wall_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._settings = settings
        self._driver = driver
        self._on_event = on_event
        self._on_status = on_status
        self._monotonic_s = monotonic_s
        self._wall_ns = wall_ns
        self._where = f"{settings.host}:{settings.port}"
        self._connection: Connection | None = None
        self._status = LinkStatus(LinkState.DOWN, f"connecting to {self._where}")
        self._counts: Counter[str] = Counter()
        self._last_received: Received | None = None
        self._refusal = ""
        self._dating = Dating()
        self._rate = _Rate()

    @property
    def status(self) -> LinkStatus:
        """State of the link, in words too."""
        return self._status

    @property
    def counters(self) -> LinkCounters:
        """Counts so far."""
        return LinkCounters(units_received=self._driver.units_received, **self._counts)

    @property
    def last_received(self) -> Received | None:
        """When the last well-formed unit came; None: none yet."""
        return self._last_received

    @property
    def rate_hz(self) -> float:
        """Units a second, over the last second or so; 0 when none came."""
        return self._rate.at(self._monotonic_s())

    async def run(self) -> None:
        """Keep the link until cancelled; the connection is closed then."""
        pause_s = _FIRST_PAUSE_S
        while True:
            if await self._attempt():
                pause_s = _FIRST_PAUSE_S
            # Spread: the gateways of a hall must not all knock on a restarted controller at once.
            await asyncio.sleep(pause_s * random.uniform(0.8, 1.2))
            pause_s = min(pause_s * 2.0, _LONGEST_PAUSE_S)

    def send(self, data: bytes) -> None:
        """Write a whole unit to the socket, now. Nothing is ever queued, so nothing goes before it.

        On return the unit is in the hands of the operating system, whole. After an error it is not,
        and it will not be done later. Works on a SILENT link too: a stop is worth trying there.

        Raises:
            LinkDownError: If there is no connection.
            LinkCloggedError: If the socket does not take it whole; the connection is given up then.
        """
        if self._connection is None:
            raise LinkDownError(f"not sent: {self._status.text}")
        self._connection.write(data)
        self._counts["units_sent"] += 1
        self._counts["bytes_sent"] += len(data)

    async def _attempt(self) -> bool:
        """One connection, from the attempt to its end; whether units came over it."""
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(self._settings.connect_timeout_s):
                _, connection = await loop.create_connection(
                    lambda: Connection(self._made, self._receive), self._settings.host, self._settings.port
                )
        except TimeoutError:
            self._tell(LinkState.DOWN, f"{self._where} does not answer")
            return False
        except OSError as error:
            self._tell(LinkState.DOWN, f"cannot connect to {self._where}: {reason_of(error)}")
            return False
        units_before = self._driver.units_received
        text = "the link was closed"
        try:
            text = await self._watch(connection)
        finally:
            self._connection = None
            await connection.end()
            self._tell(LinkState.DOWN, text)
        return self._driver.units_received > units_before and not self._refusal

    async def _watch(self, connection: Connection) -> str:
        """Wait for the connection's end, telling silence; the reason of the end in words."""
        connected_s = self._monotonic_s()
        patience_s, limit_s = self._settings.stale_after_s, self._settings.reconnect_after_s
        while not connection.lost.done():
            last_s = self._last_received.monotonic_s if self._last_received else connected_s
            quiet_s = self._monotonic_s() - max(last_s, connected_s)
            if quiet_s >= limit_s:
                return f"{self._where} sent nothing for {limit_s:g} s; connecting again"
            if quiet_s >= patience_s and self._status.state is LinkState.UP:
                self._tell(LinkState.SILENT, f"{self._where} has sent nothing for {patience_s:g} s")
            deadline_s = patience_s if quiet_s < patience_s else limit_s
            await asyncio.wait([connection.lost], timeout=deadline_s - quiet_s)
        end = connection.lost.result()
        return (
            f"{self._where} refused the connection: {self._refusal}"
            if self._refusal
            else f"{self._where}: {end}"
        )

    def _made(self, connection: Connection) -> None:
        self._driver.connected()
        self._dating = Dating()
        self._connection = connection
        self._refusal = ""
        self._counts["connections"] += 1
        self._tell(LinkState.SILENT, f"connected to {self._where}, no unit yet")

    def _receive(self, data: bytes) -> None:
        # Dated before it is parsed: what we do with it is not part of its age.
        now = Received(self._monotonic_s(), self._wall_ns())
        units_before, refusals_before = self._driver.units_received, self._driver.refusals_received
        events = self._driver.receive(data)
        self._counts["bytes_received"] += len(data)
        if units := self._driver.units_received - units_before:
            self._rate.count(units, now.monotonic_s)
        dates = [self._date(event, now) for event in events]
        for event in events:
            self._count(event)
        if units > self._driver.refusals_received - refusals_before:
            self._refusal = ""
            self._alive(max(dates, key=lambda date: date.monotonic_s, default=now), now)
        for event, date in zip(events, dates, strict=True):
            self._on_event(event, date)

    def _date(self, event: ControllerEvent, now: Received) -> Received:
        match event:
            case JointsReceived() | StatusReceived():
                return self._dating.date(event.controller_time_s, now)
            case _:
                return self._dating.date(None, now)

    def _alive(self, newest: Received, now: Received) -> None:
        self._last_received = newest
        old = now.monotonic_s - newest.monotonic_s >= self._settings.stale_after_s
        if not old and self._status.state is not LinkState.UP:
            self._tell(LinkState.UP, f"connected to {self._where}")

    def _count(self, event: ControllerEvent) -> None:
        match event:
            case MalformedReceived():
                self._counts["units_malformed"] += 1
            case UnknownReceived():
                self._counts["records_unknown"] += 1
            case Refused(_, text):
                self._counts["refusals"] += 1
                if self._status.state is not LinkState.UP:
                    self._refusal = text

    def _tell(self, state: LinkState, text: str) -> None:
        status = LinkStatus(state, text)
        if status == self._status:
            return
        self._status = status
        logger.info("link %s: %s", state.value, text)
        self._on_status(status)


class _Rate:
    """Units a second, counted over bins of a second."""

    def __init__(self) -> None:
        self._begin_s = 0.0
        self._units = 0
        self._hz = 0.0
        self._last_s = 0.0

    def count(self, units: int, now_s: float) -> None:
        elapsed_s = now_s - self._begin_s
        if elapsed_s >= 1.0:
            # After a pause there is no rate to tell yet.
            self._hz = self._units / elapsed_s if elapsed_s < 2.0 else 0.0
            self._begin_s, self._units = now_s, 0
        self._units += units
        self._last_s = now_s

    def at(self, now_s: float) -> float:
        return self._hz if now_s - self._last_s < 2.0 else 0.0
