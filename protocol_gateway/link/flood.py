"""Flood protection: detects floods, and then dispatches only the newest event of each kind.

    calm --over 2,000 units a second--> flood: the newest of each kind, 200 times a second
    flood --over 2 MiB or 20,000 units a second--> deluge: read in small chunks, and discarded
    deluge --half a second with a quarter of it, and nothing left to read--> calm

Of a burst after a gap only the newest undated state is dispatched, because the age of the others is unknown.
"""

import asyncio
from collections.abc import Callable, Hashable, Sequence
from functools import partial

from protocol_gateway.link.timestamping import EventTime
from protocol_gateway.seam import (
    AlarmReceived,
    ControllerEvent,
    JointsReceived,
    Refused,
    SignalsReceived,
    StatusReceived,
)

# Limits for half a second: twice what the fastest controllers send (1,000 units a second, of 300 bytes).
_BIN_S = 0.5
_MOST_UNITS = 1000
_CALM_UNITS = 800
# Limit for half a core of parsing: above it, one controller would starve the others.
_MOST_BYTES = 1 << 20
_MOST_READ_UNITS = 10_000
_CALM_BYTES = 1 << 18
_HOLD_S = 0.005


class FloodDetector:
    """Detector of far more data than a controller sends.

    Attributes:
        active: More than 2,000 units a second were received, without a calm half second since.
        deluge: Too much is received to parse any of it.
    """

    def __init__(self) -> None:
        self.active = self.deluge = False
        self._begin_s = 0.0
        self._units = self._bytes = 0
        self._more_waited = False

    def add_bytes(self, length: int, now_s: float, *, more_waits: bool) -> None:
        """Add bytes before they are parsed; `more_waits`: more bytes may wait in the socket."""
        if now_s - self._begin_s >= _BIN_S:
            self.deluge = self.deluge and (more_waits or self._more_waited or self._bytes > _CALM_BYTES)
            self.active = self.deluge or (self.active and self._units >= _CALM_UNITS)
            self._begin_s, self._units, self._bytes, self._more_waited = now_s, 0, 0, False
        self._bytes += length
        self._more_waited = self._more_waited or more_waits
        self.deluge = self.deluge or self._bytes > _MOST_BYTES
        self.active = self.active or self.deluge

    def add_units(self, units: int) -> None:
        """Add the number of units parsed from the last bytes."""
        self._units += units
        self.active = self.active or self._units > _MOST_UNITS
        self.deluge = self.deluge or self._units > _MOST_READ_UNITS


class EventDispatcher:
    """Dispatcher of events: immediately, or in a flood the newest of each kind within 5 ms.

    Args:
        on_event: Callback for each event.
        later: Schedules a call after a delay [s], as long as the connection lasts.

    Attributes:
        flood: Detector, which needs the number of received bytes and units.
        skipped: Number of joint positions that newer ones replaced.
    """

    def __init__(
        self,
        on_event: Callable[[ControllerEvent, EventTime], None],
        later: Callable[[float, Callable[[], None]], asyncio.TimerHandle],
    ) -> None:
        self.flood = FloodDetector()
        self.skipped = 0
        self._on_event = on_event
        self._later = later
        self._deferred: dict[Hashable, Callable[[], None]] = {}
        self._timer: asyncio.TimerHandle | None = None

    def dispatch(self, events: Sequence[ControllerEvent], dates: Sequence[EventTime], *, burst: bool) -> None:
        """Dispatch the events of one read; `burst`: they may have been delayed on the way."""
        if burst:
            self._restart_timer()
        elif self._deferred and not self.flood.active:
            self._flush()
        for event, date in zip(events, dates, strict=True):
            if self.flood.active or (burst and _is_undated_state(event)):
                older = self.defer(_kind(event), partial(self._on_event, event, date))
            else:
                older = bool(self._deferred) and self._deferred.pop(_kind(event), None) is not None
                self._on_event(event, date)
            self.skipped += older and isinstance(event, JointsReceived)

    def defer(self, kind: Hashable, call: Callable[[], None]) -> bool:
        """Defer a call until the next flush; return whether it replaces an older one of its kind."""
        older = self._deferred.pop(kind, None)
        self._deferred[kind] = call
        if self._timer is None:
            self._timer = self._later(_HOLD_S, self._flush)
        return older is not None

    def forget(self) -> None:
        """Discard the deferred calls."""
        self._deferred = {}
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _restart_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = self._later(_HOLD_S, self._flush)

    def _flush(self) -> None:
        held = self._deferred
        self.forget()
        for call in held.values():
            call()


def _is_undated_state(event: ControllerEvent) -> bool:
    """Return whether an event holds the robot's state without the controller's time."""
    states = JointsReceived | StatusReceived | SignalsReceived
    return isinstance(event, states) and event.controller_time_s is None


def _kind(event: ControllerEvent) -> Hashable:
    """Return the kind of an event: a newer event replaces an older one of the same kind."""
    match event:
        case StatusReceived(activity, mode, homed, trace):
            # A status with other values is never skipped.
            return StatusReceived, activity, mode, homed, trace
        case Refused(number):
            return Refused, number
        case AlarmReceived():
            return event
        case SignalsReceived(values):
            # Other signals are not a newer report of these.
            return SignalsReceived, tuple(signal for signal, _ in values)
        case _:
            return (type(event),)
