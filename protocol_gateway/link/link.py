"""Link to one controller: keeps the driver's channels connected, and performs what the driver returns.

    DOWN --a channel that carries READING is connected--> SILENT --unit--> UP
    UP --no unit of use for stale_after_s--> SILENT --none for reconnect_after_s--> DOWN
    any --no such channel left--> DOWN, connecting again (`channel`)

The sockets are read continuously, because data waiting in the kernel's buffers would look new later. Of a
flood, and of a burst after a gap, the newest of each kind is dispatched and the rest is counted (`flood`).
The link is SILENT if the controller's units have another joint count, or positions that cannot be
(`plausibility`), or if it sends over 2 MiB a second. It stays connected then, so that a stop can be sent.

Data is stamped once: with the time of the read, or earlier by the controller's clock (`timestamping`); an
answer without such a clock in the middle between its question and its receipt.
"""

import asyncio
import logging
import math
import time
from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, field
from operator import attrgetter

from protocol_gateway.link.channel import KeptChannel
from protocol_gateway.link.connection import READ_BYTES
from protocol_gateway.link.flood import EventDispatcher, FloodDetector
from protocol_gateway.link.health import AnswerTimes, Arrivals, LinkHealth, LossCounter, ResponseTimer
from protocol_gateway.link.plausibility import Plausibility
from protocol_gateway.link.status import LinkState, LinkStatus
from protocol_gateway.link.timers import Timers
from protocol_gateway.link.timestamping import EventTime, Timestamper
from protocol_gateway.seam import (
    Carries,
    Channel,
    Close,
    ControllerEvent,
    Driver,
    Effect,
    Effects,
    FateUnknown,
    FollowsControl,
    JointsReceived,
    MalformedReceived,
    Open,
    Refused,
    Report,
    Send,
    SetTimer,
    StatusReceived,
    StopDepends,
    StopEnds,
    UnknownReceived,
)
from protocol_gateway.seam.errors import LinkDownError, LinkError
from robomesh import reason_codes as codes
from robomesh.publications.wall_clock import WallClock
from robomesh.reasons import Reason
from robomesh.service.loop_turns import LoopTurns, turns_of
from robots.kinematics.joints import Joints

__all__ = [
    "ControllerLink",
    "EventTime",
    "LinkCounters",
    "LinkSettings",
    "LinkState",
    "LinkStatus",
]

logger = logging.getLogger(__name__)

# Of a deluge, one chunk of 4 KiB is discarded this often: cheap, and its end is detected.
_DELUGE_EACH_S = 0.0025
JOINT_COUNT, JOINT_VALUES = "controller.joint_count", "controller.joint_values"
"""Codes of units whose positions are unusable: they invalidate all positions for the stale time."""


@dataclass(frozen=True, kw_only=True)
class LinkSettings:
    """Address of the controller, and the link's timeouts.

    Attributes:
        ports: Other ports than the driver's for its further channels, by the channel's name.
        stale_after_s: Without a unit for this long the link is SILENT.
        reconnect_after_s: Without a unit for this long the link reconnects.
        connect_timeout_s: Timeout of one attempt to connect.
    """

    host: str
    port: int
    ports: Mapping[str, int] = field(default_factory=dict)
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

    `on_event`, `on_status` and `on_channel` are called on the event loop from the socket's callback: no
    queue, no task switch. They must return soon, and an exception in them ends `run`. `on_channel` gets each
    change of a channel that does not carry READING: why it is not connected; None: it is. `on_fate_unknown`
    gets why the driver wants a stop.

    Args:
        tolerates: Returns whether joint positions that cannot be are passed on, given the reason.
    """

    def __init__(
        self,
        settings: LinkSettings,
        driver: Driver,
        joints: Joints,
        *,
        on_event: Callable[[ControllerEvent, EventTime], None],
        on_status: Callable[[LinkStatus], None] = lambda status: None,
        on_channel: Callable[[Channel, Reason | None], None] = lambda channel, why: None,
        on_fate_unknown: Callable[[Reason], None] = lambda why: None,
        tolerates: Callable[[Reason], bool] = lambda why: False,
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._settings = settings
        self._driver = driver
        # Checked once: before Python 3.12 a check takes as long as a unit.
        self._stop_depends = driver if isinstance(driver, StopDepends) else None
        self._on_status = on_status
        self._on_channel = on_channel
        self._on_fate_unknown = on_fate_unknown
        self._tolerates = tolerates
        self._monotonic_s = monotonic_s
        self._wall_clock = WallClock()
        self._where = f"{settings.host}:{settings.port}"
        self._channels: dict[str, KeptChannel] = {}
        self._tasks: dict[KeptChannel, asyncio.Task[None]] = {}
        self._in_a_hurry: set[str] = set()
        self._failed: asyncio.Future[None] | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._timers = Timers()
        self._timer_s = 0.0
        self._ran: Callable[[object, float], None] = LoopTurns().ran
        self._is_controlled = False
        self._unasked = UnaskedSends(driver.requests_a_second)
        self._connected_s = self._units_at_connect = 0.0
        self._status = LinkStatus(LinkState.DOWN, codes.LINK_CONNECTING(where=self._where))
        self._counts: Counter[str] = Counter()
        self._last_received: EventTime | None = None
        self._refusal = ""
        self._unusable: tuple[float, Reason, str] | None = (
            None  # time of the last unusable data, reason, and the event's code
        )
        self._plausibility = Plausibility(joints)
        self._timestamper = Timestamper()
        self._arrivals = Arrivals()
        self._losses = LossCounter()
        self._response_timer = ResponseTimer()
        self._questions = AnswerTimes()
        self._unanswered = 0
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
            units_lost=self._losses.lost + self._unanswered,
            units_skipped=self._dispatcher.skipped,
            **self._counts,
        )

    @property
    def last_received(self) -> EventTime | None:
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
            network_round_trip_s=next((each.round_trip_s for each in self._readable()), None),
            answer_s=self._response_timer.answer_s,
            stamp_uncertainty_s=self._questions.stamp_uncertainty_s(self._monotonic_s()),
        )

    async def run(self) -> None:
        """Keep the channels connected until cancelled; then close them."""
        loop = asyncio.get_running_loop()
        self._failed = loop.create_future()
        self._ran = turns_of(loop).ran
        try:
            self._tell(self._driver.started(self._monotonic_s()))
            self.controlled(self._is_controlled)
            await self._failed
        finally:
            self._failed.cancel()
            self._timers.clear()
            self._wait_for_timers()
            # The driver does not hear of these ends, so it opens nothing.
            self._channels.clear()
            tasks = [*self._tasks.values()]
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    def send(self, prepared: object) -> None:
        """Send what the driver's `prepare` returned to the controller immediately.

        On return the operating system has all of it. After an error it has not, and it will not be sent
        later. Works on a SILENT link too, so that a stop can be tried.

        Raises:
            LinkDownError: If there is no connection.
            LinkCloggedError: If the socket does not take the whole unit; the connection is then aborted.
            NotReadyError: If the driver does not send it now.
        """
        now = self._now()
        failure: LinkError | None = None
        sent = False
        for effect in self._driver.command(prepared, now.monotonic_s):
            if not isinstance(effect, Send):
                self._perform(effect, now)
                continue
            try:
                self._write(effect)
                sent = True
            except LinkError as error:
                if not effect.alternative:
                    raise
                failure = failure or error
        if failure is not None and not sent:
            raise failure
        self._response_timer.command_sent(now.monotonic_s)

    def controlled(self, taken: bool) -> None:
        """Tell a started driver whether an operator controls the robot, if it follows control."""
        self._is_controlled = taken
        running = self._failed is not None and not self._failed.done()
        if running and isinstance(self._driver, FollowsControl):
            self._tell(self._driver.controlled(taken, self._monotonic_s()))

    def carries(self, what: Carries) -> bool:
        """Return whether a channel that carries it is connected."""
        return any(kept.connection and what in kept.channel.carries for kept in self._channels.values())

    @property
    def stop_ends(self) -> StopEnds | None:
        """Motion that a stop request ends now; None: it cannot be sent, or the controller refuses it."""
        if not self.carries(Carries.STOP):
            return None
        if self._stop_depends is not None:
            return self._stop_depends.stop_ends_now(self._monotonic_s())
        return self._driver.capabilities.stop_ends

    def defer_in_flood(self, kind: Hashable, call: Callable[[], None]) -> bool:
        """Defer a call in a flood, where only the newest of each kind is done; return whether deferred."""
        if self._dispatcher.flood.active:
            self._dispatcher.defer(kind, call)
        return self._dispatcher.flood.active

    # --------------------------------------------------------- effects of the driver

    def _tell(self, effects: Effects, now: EventTime | None = None) -> None:
        """Perform what the driver returns when something happened, now unless a time is given."""
        now = now or self._now()
        # The end of a motion that the driver gives up is always sent.
        gives_up = FateUnknown in map(type, effects)
        # Timers first: a stop that follows from the others may set the same ones.
        if gives_up:
            effects = sorted(effects, key=lambda each: not isinstance(each, SetTimer))
        for effect in effects:
            self._perform(effect, now, counted=not gives_up)

    def _perform(self, effect: Effect, now: EventTime, *, counted: bool = True) -> None:
        match effect:
            case Report():
                self._report(effect, now)
            case Send():
                self._send_unasked(effect, now.monotonic_s, counted=counted)
            case SetTimer():
                self._timers.set(effect)
                self._wait_for_timers()
            case Open():
                self._open(effect)
            case Close(channel, why):
                self._close(channel.name, why)
            case FateUnknown(why_unknown):
                self._on_fate_unknown(why_unknown)

    def _send_unasked(self, effect: Send, now_s: float, *, counted: bool) -> None:
        if counted and not self._unasked.allowed(now_s):
            logger.error("%s: the driver sends more questions than it declares", self._where)
            return
        try:
            self._write(effect)
        except LinkError as error:
            # The driver hears of the connection's end, and asks again on the next one.
            logger.debug("%s: %s", self._where, error)

    def _write(self, effect: Send) -> None:
        name = effect.channel.name
        if name not in self._channels:
            # Before the driver has opened it: a stop that is latched since the last run of the gateway.
            self._in_a_hurry.add(name)
            raise LinkDownError(self._status.reason)
        self._channels[name].write(effect.data)
        self._counts["units_sent"] += 1
        self._counts["bytes_sent"] += len(effect.data)

    def _wait_for_timers(self) -> None:
        """Wait for the first of the driver's timers."""
        at_s = self._timers.next_s
        if self._timer is not None:
            if at_s == self._timer_s:
                return
            self._timer.cancel()
            self._timer = None
        if at_s is not None:
            self._timer_s = at_s
            self._timer = self._later(max(0.0, at_s - self._monotonic_s()), self._end_timers)

    def _end_timers(self) -> None:
        self._timer = None
        now_s = self._monotonic_s()
        # The loop's clock may be a little before ours.
        ended = self._timers.take(max(now_s, self._timer_s))
        self._tell(self._driver.timer_ended(ended, now_s))
        self._wait_for_timers()
        self._ran(self, now_s)

    def _open(self, effect: Open) -> None:
        self._close(effect.channel.name)
        port = self._settings.port if effect.port is None else effect.port
        port = self._settings.ports.get(effect.channel.name, port)
        kept = KeptChannel(
            effect.channel,
            self._settings.host,
            port,
            self._settings.connect_timeout_s,
            listener=self,
            settings=effect.settings,
        )
        self._channels[effect.channel.name] = kept
        if effect.channel.name in self._in_a_hurry:
            self._in_a_hurry.discard(effect.channel.name)
            kept.hurry()
        task = self._tasks[kept] = asyncio.create_task(kept.run())
        task.add_done_callback(lambda task: self._channel_ended(kept, task))

    def _close(self, name: str, why: str = "") -> None:
        kept = self._channels.pop(name, None)
        if kept is not None:
            if why:
                kept.reason = codes.LINK_REFUSED(where=kept.where, detail=why)
                if Carries.READING not in kept.channel.carries and not kept.channel.brief:
                    self._on_channel(kept.channel, kept.reason)
            self._tasks[kept].cancel()

    def _channel_ended(self, kept: KeptChannel, task: asyncio.Task[None]) -> None:
        del self._tasks[kept]
        if not task.cancelled() and (error := task.exception()) is not None:
            self._fail(error)

    def _later(self, seconds: float, call: Callable[[], None]) -> asyncio.TimerHandle:
        """Schedule a call; an exception in it ends `run`."""

        def call_or_fail() -> None:
            try:
                call()
            except Exception as error:
                self._fail(error)

        return asyncio.get_running_loop().call_later(seconds, call_or_fail)

    def _fail(self, error: BaseException) -> None:
        assert self._failed is not None
        if not self._failed.done():
            self._failed.set_exception(error)

    # ------------------------------------------------------------------- connections

    def on_opened(self, kept: KeptChannel) -> None:
        """Begin a connection (called by the channel)."""
        self._counts["connections"] += not kept.channel.brief
        reads = Carries.READING in kept.channel.carries
        if reads:
            self._timestamper.connected()
            self._plausibility.connected()
            self._losses.forget()
            self._dispatcher.flood = FloodDetector()
            self._unusable = None
            self._refusal = ""
            self._connected_s = self._monotonic_s()
            self._units_at_connect = self._counts["units_received"]
        self._tell(self._driver.opened(kept.channel, self._monotonic_s()))
        if reads:
            self._set_status(LinkState.SILENT, codes.LINK_NO_UNIT(where=kept.where))
        elif not kept.channel.brief:
            self._on_channel(kept.channel, None)

    def on_ended(self, kept: KeptChannel) -> bool:
        """Handle the end of a connection, or a failed attempt (called by the channel)."""
        reads = Carries.READING in kept.channel.carries
        if self._refusal and kept.reason.code == codes.LINK_LOST.name:
            kept.reason = codes.LINK_REFUSED(where=kept.where, detail=self._refusal)
        if reads and not any(self._readable()):
            self._dispatcher.forget()
            self._set_status(LinkState.DOWN, kept.reason)
        if self._channels.get(kept.channel.name) is kept:
            self._tell(self._driver.closed(kept.channel, self._monotonic_s()))
            if not reads and not kept.channel.brief:
                self._on_channel(kept.channel, kept.reason)
        if not reads:
            return False
        return self._counts["units_received"] > self._units_at_connect and not self._refusal

    def patience(self, kept: KeptChannel) -> float | Reason:
        """Return how long to wait for units, or why to connect again; report silence."""
        if Carries.READING not in kept.channel.carries:
            return math.inf
        now_s = self._monotonic_s()
        patience_s, limit_s = self._settings.stale_after_s, self._settings.reconnect_after_s
        quiet_s = now_s - self._heard_s
        mute_s = quiet_s if self._unusable is None else now_s - self._unusable[0]
        if mute_s >= limit_s:
            return codes.LINK_RECONNECTS(where=kept.where)
        self._note_silence(now_s)
        return patience_s - quiet_s if quiet_s < patience_s else limit_s - mute_s

    @property
    def _heard_s(self) -> float:
        """Time of the last unit, or of the connection if there was none since."""
        return max(self._last_received.monotonic_s if self._last_received else 0.0, self._connected_s)

    def _note_silence(self, now_s: float) -> None:
        if self._status.state is LinkState.UP and now_s - self._heard_s >= self._settings.stale_after_s:
            self._fall_silent()

    def _readable(self) -> Iterator[KeptChannel]:
        """Yield the connected channels that carry READING."""
        for kept in self._channels.values():
            if kept.connection is not None and Carries.READING in kept.channel.carries:
                yield kept

    # ---------------------------------------------------------------- received bytes

    def on_received(self, kept: KeptChannel, data: bytes) -> None:
        """Hand received bytes to the driver (called by the channel)."""
        # Stamped before it is parsed, so that parsing does not count as age.
        now = self._now()
        self._counts["bytes_received"] += len(data)
        # A gateway that was itself suspended has seen nothing, although the system kept the units for it.
        self._note_silence(now.monotonic_s)
        if self._is_deluge(kept, len(data), now.monotonic_s):
            return
        self._tell(self._driver.received(kept.channel, data, now.monotonic_s), now)
        self._ran(self, now.monotonic_s)

    def _report(self, report: Report, now: EventTime) -> None:
        events, units = report.events, report.units
        self._unanswered += report.lost
        if units:
            self._counts["units_received"] += units
            self._arrivals.count(units, now.monotonic_s)
        for event in events:
            self._count(event, now.monotonic_s)
        self._dispatcher.flood.add_units(max(units, len(events)))
        unusable = self._sends_unusable_joints(now.monotonic_s)
        if unusable:
            # The link reports this once. Which of the positions are this robot's is unknown.
            events = [each for each in events if not _is_of_joints(each)]
            self._fall_silent()
        for event in events:
            self._note_losses(event)
        if report.asked_s is not None:
            now = self._questions.answered(report.asked_s, now)
        dates = self._timestamper.timestamps(events, now)
        if units > report.refusals and not unusable:
            self._refusal, self._unusable = "", None
            self._unit_received(max(dates, key=attrgetter("monotonic_s"), default=now), now)
        elif not units and self._unusable is not None and self._status.state is LinkState.SILENT:
            self._fall_silent()
            return  # reported once, not for each unit
        if self._dispatcher.flood.active is not self._status.flooding:
            self._set_status(self._status.state, self._status.reason, self._status.code)
        self._dispatcher.dispatch(events, dates, burst=self._timestamper.after_gap(now.monotonic_s))

    def _is_deluge(self, kept: KeptChannel, length: int, now_s: float) -> bool:
        """Return whether bytes are discarded because they are far too many. Stops can still be sent."""
        before = self._dispatcher.flood.deluge
        more_waits = length == READ_BYTES and not kept.channel.datagrams
        self._dispatcher.flood.add_bytes(length, now_s, more_waits=more_waits)
        if self._dispatcher.flood.deluge:
            assert kept.connection is not None
            kept.connection.pause(_DELUGE_EACH_S)
            self._unusable = now_s, codes.LINK_DELUGE(where=self._where), "link.deluge"
            self._fall_silent()
        elif before:
            self._tell(self._driver.skipped(kept.channel, now_s))
            self._losses.forget()
        return before or self._dispatcher.flood.deluge

    def _sends_unusable_joints(self, now_s: float) -> bool:
        """Return whether a unit with unusable joints was received within the stale time."""
        if self._unusable is None or self._unusable[2] not in (JOINT_COUNT, JOINT_VALUES):
            return False
        return now_s - self._unusable[0] < self._settings.stale_after_s

    def _fall_silent(self) -> None:
        if self._unusable is None:
            self._dispatcher.flood = FloodDetector()
            self._set_status(LinkState.SILENT, codes.LINK_NO_DATA(where=self._where))
        else:
            _, reason, code = self._unusable
            self._set_status(LinkState.SILENT, reason, code)

    def _now(self) -> EventTime:
        if self._wall_clock.was_set():
            self._timestamper.wall_clock_was_set()
        now_s = self._monotonic_s()
        return EventTime(now_s, self._wall_clock.earliest_ns(round(now_s * 1e9)))

    def _note_losses(self, event: ControllerEvent) -> None:
        if isinstance(event, JointsReceived | StatusReceived):
            if self._dispatcher.flood.active:
                self._losses.forget()
            elif event.controller_time_s is not None:
                self._losses.add(event.controller_time_s)
            elif isinstance(event, JointsReceived):
                # Such as a repetition while nothing changes: the gap before the next TIME is no loss.
                self._losses.forget()

    def _unit_received(self, newest: EventTime, now: EventTime) -> None:
        self._last_received = newest
        old = now.monotonic_s - newest.monotonic_s >= self._settings.stale_after_s
        if not old and self._status.state is not LinkState.UP:
            self._set_status(LinkState.UP, codes.LINK_CONNECTED(where=self._where))

    def _count(self, event: ControllerEvent, now_s: float) -> None:
        match event:
            case JointsReceived(positions, velocities):
                why = self._plausibility.problem(positions, velocities, now_s)
                if why is not None and not self._tolerates(why):
                    self._counts["units_malformed"] += 1
                    self._note_unusable(now_s, why, JOINT_VALUES)
            case StatusReceived():
                self._plausibility.follow(event)
                self._response_timer.event_received(event, now_s)
            case MalformedReceived():
                self._counts["units_malformed"] += 1
                if event.joint_count is not None:
                    self._note_unusable(now_s, event.joint_count, JOINT_COUNT)
            case UnknownReceived():
                self._counts["records_unknown"] += 1
            case Refused(_, text):
                self._response_timer.event_received(event, now_s)
                self._counts["refusals"] += 1
                if self._status.state is not LinkState.UP:
                    self._refusal = text

    def _note_unusable(self, now_s: float, why: Reason, code: str) -> None:
        """Keep the first reason: each unit may have another one."""
        before = self._unusable
        if before is None or before[2] != code:
            reason = codes.LINK_OTHER_JOINTS(why, where=self._where)
        else:
            reason = before[1]
        self._unusable = now_s, reason, code

    def _set_status(self, state: LinkState, reason: Reason, code: str = "") -> None:
        flooding = self._dispatcher.flood.active and state is not LinkState.DOWN
        status = LinkStatus(state, reason, code, flooding)
        if status == self._status:
            return
        self._status = status
        logger.info("link %s: %s", state.value, reason)
        self._on_status(status)


class UnaskedSends:
    """Limit for unasked sends of a driver: as many a second as it declares, and that many together."""

    def __init__(self, most_a_second: float) -> None:
        self._most = self._left = most_a_second
        self._at_s = 0.0

    def allowed(self, now_s: float) -> bool:
        """Return whether one more may be sent now, and count it."""
        self._left = min(self._most, self._left + (now_s - self._at_s) * self._most)
        self._at_s = now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


def _is_of_joints(event: ControllerEvent) -> bool:
    """Return whether an event holds joint positions, or reports a wrong joint count."""
    return isinstance(event, JointsReceived) or (
        isinstance(event, MalformedReceived) and event.joint_count is not None
    )
