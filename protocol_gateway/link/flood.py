"""More than is taken: how much is too much, and the newest of each kind in place of all.

    calm --over 2,000 units a second--> flood: the newest of each kind, 200 times a second
    flood --over 2 MiB or 20,000 units a second--> deluge: read a piece at a time, and thrown away unread
    deluge --half a second of a quarter of it, and nothing left to read--> calm

After a gap the newest of a burst is handed over alone, where nobody can say how old the others are.
"""

import asyncio
from collections.abc import Callable, Hashable, Sequence
from functools import partial

from protocol_gateway.drivers.driver import ControllerEvent, JointsReceived, Refused, StatusReceived
from protocol_gateway.link.timestamping import Received

# Twice what the fastest controllers send (1,000 units a second, of 300 bytes), within half a second.
_BIN_S = 0.5
_MOST_UNITS = 1000
_CALM_UNITS = 800
# What can be parsed in half a core's time: beyond it, one controller would starve the others.
_MOST_BYTES = 1 << 20
_MOST_READ_UNITS = 10_000
_CALM_BYTES = 1 << 18
_HOLD_S = 0.005


class FloodDetector:
    """Whether far more comes than a controller sends.

    Attributes:
        active: More than 2,000 units a second came, and no calm half second since.
        deluge: So much came that nothing of it can be taken, and it has not ended yet.
    """

    def __init__(self) -> None:
        self.active = self.deluge = False
        self._begin_s = 0.0
        self._units = self._bytes = 0
        self._more_waited = False

    def add_bytes(self, length: int, now_s: float, *, more_waits: bool) -> None:
        """Bytes came, and are not parsed yet; `more_waits`: there may be more behind them."""
        if now_s - self._begin_s >= _BIN_S:
            self.deluge = self.deluge and (more_waits or self._more_waited or self._bytes > _CALM_BYTES)
            self.active = self.deluge or (self.active and self._units >= _CALM_UNITS)
            self._begin_s, self._units, self._bytes, self._more_waited = now_s, 0, 0, False
        self._bytes += length
        self._more_waited = self._more_waited or more_waits
        self.deluge = self.deluge or self._bytes > _MOST_BYTES
        self.active = self.active or self.deluge

    def add_units(self, units: int) -> None:
        """Of the bytes that came last, so many units were read."""
        self._units += units
        self.active = self.active or self._units > _MOST_UNITS
        self.deluge = self.deluge or self._units > _MOST_READ_UNITS


class EventDispatcher:
    """Hands over what came: all of it at once; of too much the newest of each kind, within 5 ms.

    Args:
        on_event: Takes it.
        later: Calls something after seconds, as long as there is a connection.

    Attributes:
        flood: To be told of what comes.
        skipped: So many positions, for newer ones.
    """

    def __init__(
        self,
        on_event: Callable[[ControllerEvent, Received], None],
        later: Callable[[float, Callable[[], None]], asyncio.TimerHandle],
    ) -> None:
        self.flood = FloodDetector()
        self.skipped = 0
        self._on_event = on_event
        self._later = later
        self._deferred: dict[Hashable, Callable[[], None]] = {}
        self._timer: asyncio.TimerHandle | None = None

    def dispatch(self, events: Sequence[ControllerEvent], dates: Sequence[Received], *, burst: bool) -> None:
        """Hand over what was read at once; `burst`: it may have been held back on the way."""
        if burst:
            self._restart_timer()
        elif not self.flood.active:
            self._flush()
        for event, date in zip(events, dates, strict=True):
            if self.flood.active or (burst and _is_undated_state(event)):
                older = self.defer(_kind(event), partial(self._on_event, event, date))
            else:
                older = self._deferred.pop(_kind(event), None) is not None
                self._on_event(event, date)
            self.skipped += older and isinstance(event, JointsReceived)

    def defer(self, kind: Hashable, call: Callable[[], None]) -> bool:
        """Do it soon, unless something newer of its kind comes; whether it is in an older one's place."""
        older = self._deferred.pop(kind, None)
        self._deferred[kind] = call
        if self._timer is None:
            self._timer = self._later(_HOLD_S, self._flush)
        return older is not None

    def forget(self) -> None:
        """Hand over nothing of what is held."""
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
    """Whether an event tells the arm's state, and not of what time."""
    return isinstance(event, JointsReceived | StatusReceived) and event.controller_time_s is None


def _kind(event: ControllerEvent) -> Hashable:
    """What a newer event must have in common with an older one to stand for it."""
    match event:
        case StatusReceived(activity, mode, homed, trace):
            # One that says something else is never left out.
            return StatusReceived, activity, mode, homed, trace
        case Refused(number):
            return Refused, number
        case _:
            return (type(event),)
