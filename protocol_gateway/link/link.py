"""Link to one controller: keeps a connection, reports its state, dispatches every event immediately.

    DOWN --connected--> SILENT --unit--> UP
    UP --no unit of use for stale_after_s--> SILENT --none for reconnect_after_s--> DOWN
    any --connection lost--> DOWN --a pause, 0.2 s growing to 5 s--> reconnect
                                  --a unit could not be sent--> reconnect immediately, then each 0.2 s

The socket is read continuously, because data waiting in the kernel's buffers would look new later. Of a
flood, and of a burst after a gap, the newest of each kind is dispatched and the rest is counted (`flood`).
The link is SILENT if the controller's units have another joint count, or if it sends over 2 MiB a second. It
stays connected then, so that a stop can be sent.

Data is stamped once: with the time of the read, or earlier by the controller's clock (`timestamping`).
"""

import asyncio
import contextlib
import logging
import random
import time
from collections import Counter
from collections.abc import Callable, Hashable
from dataclasses import dataclass

from protocol_gateway.drivers.driver import (
    ControllerEvent,
    Driver,
    JointsReceived,
    MalformedReceived,
    Refused,
    StatusReceived,
    UnknownReceived,
)
from protocol_gateway.errors import LinkDownError
from protocol_gateway.link.connection import READ_BYTES, Connection, reason_of
from protocol_gateway.link.flood import EventDispatcher, FloodDetector
from protocol_gateway.link.health import Arrivals, LinkHealth, LossCounter, ResponseTimer
from protocol_gateway.link.status import LinkState, LinkStatus
from protocol_gateway.link.timestamping import Received, Timestamper
from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robomesh.wall_clock import WallClock

__all__ = [
    "ControllerLink",
    "LinkCounters",
    "LinkSettings",
    "LinkState",
    "LinkStatus",
    "Received",
]

logger = logging.getLogger(__name__)

_FIRST_PAUSE_S = 0.2
_LONGEST_PAUSE_S = 5.0
# Of a deluge, one chunk of 16 KiB is discarded this often: cheap, and its end is detected.
_DELUGE_EACH_S = 0.01
JOINT_COUNT = "controller.joint_count"


@dataclass(frozen=True, kw_only=True)
class LinkSettings:
    """Address of the controller, and the link's timeouts.

    Attributes:
        stale_after_s: Without a unit for this long the link is SILENT.
        reconnect_after_s: Without a unit for this long the link reconnects.
        connect_timeout_s: Timeout of one attempt to connect.
    """

    host: str
    port: int
    stale_after_s: float = 1.0
    reconnect_after_s: float = 4.0
    connect_timeout_s: float = 3.0


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
    units_lost: int = 0
    units_skipped: int = 0


class ControllerLink:
    """A link to one controller.

    `on_event` and `on_status` are called on the event loop from the socket's callback: no queue, no task
    switch. They must return soon, and an exception in them ends `run`.
    """

    def __init__(
        self,
        settings: LinkSettings,
        driver: Driver,
        *,
        on_event: Callable[[ControllerEvent, Received], None],
        on_status: Callable[[LinkStatus], None] = lambda status: None,
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._settings = settings
        self._driver = driver
        self._on_status = on_status
        self._monotonic_s = monotonic_s
        self._wall_clock = WallClock()
        self._where = f"{settings.host}:{settings.port}"
        self._connection: Connection | None = None
        self._status = LinkStatus(LinkState.DOWN, codes.LINK_CONNECTING(where=self._where))
        self._counts: Counter[str] = Counter()
        self._last_received: Received | None = None
        self._refusal = ""
        self._unusable: tuple[float, Reason, str] | None = (
            None  # time of the last unusable data, reason, and the event's code
        )
        self._timestamper = Timestamper()
        self._arrivals = Arrivals()
        self._losses = LossCounter()
        self._response_timer = ResponseTimer()
        self._dispatcher = EventDispatcher(on_event, self._later)
        self._send_failed = asyncio.Event()

    @property
    def status(self) -> LinkStatus:
        """State of the link, with its reason."""
        return self._status

    @property
    def counters(self) -> LinkCounters:
        """Counts so far."""
        return LinkCounters(
            units_received=self._driver.units_received,
            units_lost=self._losses.lost,
            units_skipped=self._dispatcher.skipped,
            **self._counts,
        )

    @property
    def last_received(self) -> Received | None:
        """Time of the last well-formed unit; None: none yet."""
        return self._last_received

    @property
    def rate_hz(self) -> float:
        """Units a second, over about the last second; 0 if there were none."""
        return self._arrivals.rate_hz(self._monotonic_s())

    @property
    def health(self) -> LinkHealth:
        """Health of the link."""
        return LinkHealth(
            jitter_s=self._arrivals.jitter_s(self._monotonic_s()),
            network_round_trip_s=self._connection.round_trip_s if self._connection else None,
            answer_s=self._response_timer.answer_s,
        )

    async def run(self) -> None:
        """Keep the link connected until cancelled; then close the connection."""
        pause_s = _FIRST_PAUSE_S
        while True:
            if await self._attempt():
                pause_s = _FIRST_PAUSE_S
            await self._rest(pause_s)
            pause_s = min(pause_s * 2.0, _LONGEST_PAUSE_S)

    async def _rest(self, pause_s: float) -> None:
        """Pause between two attempts; only briefly after a unit could not be sent."""
        # Random spread, so that a restarted controller does not get all connections at the same time.
        spread = random.uniform(0.8, 1.2)
        if self._send_failed.is_set():
            await asyncio.sleep(_FIRST_PAUSE_S * spread)
            return
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(pause_s * spread):
                await self._send_failed.wait()

    def send(self, data: bytes) -> None:
        """Write a whole unit to the socket immediately. The link has no queue, so nothing precedes the unit.

        On return the operating system has the whole unit. After an error it has not, and the unit will not be
        sent later; until the next successful send, the link reconnects without long pauses. Works on a SILENT
        link too, so that a stop can be tried.

        Raises:
            LinkDownError: If there is no connection.
            LinkCloggedError: If the socket does not take the whole unit; the connection is then aborted.
        """
        self._send_failed.set()
        if self._connection is None:
            raise LinkDownError(self._status.reason)
        self._connection.write(data)
        self._send_failed.clear()
        self._counts["units_sent"] += 1
        self._counts["bytes_sent"] += len(data)
        self._response_timer.command_sent(self._monotonic_s())

    def defer_in_flood(self, kind: Hashable, call: Callable[[], None]) -> bool:
        """Defer a call in a flood, where only the newest of each kind is done; return whether deferred."""
        if self._dispatcher.flood.active:
            self._dispatcher.defer(kind, call)
        return self._dispatcher.flood.active

    async def _attempt(self) -> bool:
        """Connect, and serve the connection to its end; return whether usable units were received."""
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(self._settings.connect_timeout_s):
                _, connection = await loop.create_connection(
                    lambda: Connection(self._on_connected, self._receive),
                    self._settings.host,
                    self._settings.port,
                )
        except TimeoutError:
            self._set_status(LinkState.DOWN, codes.LINK_NO_ANSWER(where=self._where))
            return False
        except OSError as error:
            self._set_status(LinkState.DOWN, codes.LINK_FAILED(where=self._where, detail=reason_of(error)))
            return False
        units_before = self._driver.units_received
        reason = codes.LINK_CLOSED()
        try:
            reason = await self._watch(connection)
        finally:
            self._connection = None
            self._dispatcher.forget()
            await connection.end()
            self._set_status(LinkState.DOWN, reason)
        received = self._driver.units_received > units_before
        return received and not self._refusal

    async def _watch(self, connection: Connection) -> Reason:
        """Wait for the connection's end, reporting silence; return the reason of the end."""
        connected_s = self._monotonic_s()
        patience_s, limit_s = self._settings.stale_after_s, self._settings.reconnect_after_s
        while not connection.lost.done():
            now_s = self._monotonic_s()
            last_s = self._last_received.monotonic_s if self._last_received else connected_s
            quiet_s = now_s - max(last_s, connected_s)
            mute_s = quiet_s if self._unusable is None else now_s - self._unusable[0]
            if mute_s >= limit_s:
                return codes.LINK_RECONNECTS(where=self._where)
            if quiet_s >= patience_s and self._status.state is LinkState.UP:
                self._fall_silent()
            wait_s = patience_s - quiet_s if quiet_s < patience_s else limit_s - mute_s
            await asyncio.wait([connection.lost], timeout=wait_s)
        end = connection.lost.result()
        if self._refusal:
            return codes.LINK_REFUSED(where=self._where, detail=self._refusal)
        return codes.LINK_LOST(end, where=self._where)

    def _on_connected(self, connection: Connection) -> None:
        self._driver.connected()
        self._timestamper.connected()
        self._losses.forget()
        self._dispatcher.flood = FloodDetector()
        self._unusable = None
        self._connection = connection
        self._refusal = ""
        self._counts["connections"] += 1
        self._set_status(LinkState.SILENT, codes.LINK_NO_UNIT(where=self._where))

    def _later(self, seconds: float, call: Callable[[], None]) -> asyncio.TimerHandle:
        assert self._connection is not None
        return self._connection.later(seconds, call)

    def _receive(self, data: bytes) -> None:
        # Stamped before it is parsed, so that parsing does not count as age.
        now = self._now()
        self._counts["bytes_received"] += len(data)
        if self._is_deluge(len(data), now.monotonic_s):
            return
        units_before, refusals_before = self._driver.units_received, self._driver.refusals_received
        events = self._driver.receive(data)
        if units := self._driver.units_received - units_before:
            self._arrivals.count(units, now.monotonic_s)
        for event in events:
            self._count(event, now.monotonic_s)
        self._dispatcher.flood.add_units(max(units, len(events)))
        other_joints = self._sends_other_joints(now.monotonic_s)
        if other_joints:
            # The link reports this once. Which of the positions belong to this robot is unknown.
            events = [each for each in events if not _is_of_joints(each)]
            self._fall_silent()
        for event in events:
            self._note_losses(event)
        dates = self._timestamper.timestamps(events, now)
        if units > self._driver.refusals_received - refusals_before and not other_joints:
            self._refusal, self._unusable = "", None
            self._unit_received(max(dates, key=lambda date: date.monotonic_s, default=now), now)
        elif not units and self._unusable is not None and self._status.state is LinkState.SILENT:
            self._fall_silent()
            return  # reported once, not for each unit
        if self._dispatcher.flood.active is not self._status.flooding:
            self._set_status(self._status.state, self._status.reason, self._status.code)
        self._dispatcher.dispatch(events, dates, burst=self._timestamper.after_gap(now.monotonic_s))

    def _is_deluge(self, length: int, now_s: float) -> bool:
        """Return whether bytes are discarded because they are far too many. Stops can still be sent."""
        before = self._dispatcher.flood.deluge
        more_waits = length == READ_BYTES
        self._dispatcher.flood.add_bytes(length, now_s, more_waits=more_waits)
        if self._dispatcher.flood.deluge:
            assert self._connection is not None
            self._connection.pause(_DELUGE_EACH_S)
            self._unusable = now_s, codes.LINK_DELUGE(where=self._where), "link.deluge"
            self._fall_silent()
        elif before:
            self._driver.connected()
            self._losses.forget()
        return before or self._dispatcher.flood.deluge

    def _sends_other_joints(self, now_s: float) -> bool:
        """Return whether a unit with another joint count was received within the stale time."""
        if self._unusable is None or self._unusable[2] != JOINT_COUNT:
            return False
        return now_s - self._unusable[0] < self._settings.stale_after_s

    def _fall_silent(self) -> None:
        if self._unusable is None:
            self._dispatcher.flood = FloodDetector()
            self._set_status(LinkState.SILENT, codes.LINK_NO_DATA(where=self._where))
        else:
            _, reason, code = self._unusable
            self._set_status(LinkState.SILENT, reason, code)

    def _now(self) -> Received:
        if self._wall_clock.was_set():
            self._timestamper.wall_clock_was_set()
        now_s = self._monotonic_s()
        return Received(now_s, self._wall_clock.earliest_ns(round(now_s * 1e9)))

    def _note_losses(self, event: ControllerEvent) -> None:
        if isinstance(event, JointsReceived | StatusReceived):
            if self._dispatcher.flood.active:
                self._losses.forget()
            elif event.controller_time_s is not None:
                self._losses.add(event.controller_time_s)

    def _unit_received(self, newest: Received, now: Received) -> None:
        self._last_received = newest
        old = now.monotonic_s - newest.monotonic_s >= self._settings.stale_after_s
        if not old and self._status.state is not LinkState.UP:
            self._set_status(LinkState.UP, codes.LINK_CONNECTED(where=self._where))

    def _count(self, event: ControllerEvent, now_s: float) -> None:
        match event:
            case StatusReceived():
                self._response_timer.event_received(event, now_s)
            case MalformedReceived():
                self._counts["units_malformed"] += 1
                if event.joint_count is not None:
                    reason = codes.LINK_OTHER_JOINTS(event.joint_count, where=self._where)
                    self._unusable = now_s, reason, JOINT_COUNT
            case UnknownReceived():
                self._counts["records_unknown"] += 1
            case Refused(_, text):
                self._response_timer.event_received(event, now_s)
                self._counts["refusals"] += 1
                if self._status.state is not LinkState.UP:
                    self._refusal = text

    def _set_status(self, state: LinkState, reason: Reason, code: str = "") -> None:
        flooding = self._dispatcher.flood.active and state is not LinkState.DOWN
        status = LinkStatus(state, reason, code, flooding)
        if status == self._status:
            return
        self._status = status
        logger.info("link %s: %s", state.value, reason)
        self._on_status(status)


def _is_of_joints(event: ControllerEvent) -> bool:
    """Return whether an event holds joint positions, or reports a wrong joint count."""
    return isinstance(event, JointsReceived) or (
        isinstance(event, MalformedReceived) and event.joint_count is not None
    )
