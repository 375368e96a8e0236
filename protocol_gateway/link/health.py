"""How well a link does: rate, jitter, what never came, how soon it answers. No I/O.

Times are seconds on the gateway's monotonic clock, unless they are the controller's.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median

from protocol_gateway.drivers.driver import ControllerEvent, Refused, StatusReceived

_WINDOW_S = 5.0
_MOST_ARRIVALS = 512
_FEW = 20
_ANSWERS_WITHIN_S = 2.0
_LONGEST_GAP_S = 60.0  # of the controller's clock; further, it was set


@dataclass(frozen=True, slots=True)
class LinkHealth:
    """As in `robomesh.LinkHealth`; None: not known."""

    jitter_s: float | None
    network_round_trip_s: float | None
    answer_s: float | None


class Arrivals:
    """When units came."""

    def __init__(self) -> None:
        self._times_s: deque[float] = deque(maxlen=_MOST_ARRIVALS)
        self._begin_s = 0.0
        self._units = 0
        self._hz = 0.0

    def count(self, units: int, now_s: float) -> None:
        """Units came, all at once."""
        elapsed_s = now_s - self._begin_s
        if elapsed_s >= 1.0:
            # After a pause there is no rate to tell yet.
            self._hz = self._units / elapsed_s if elapsed_s < 2.0 else 0.0
            self._begin_s, self._units = now_s, 0
        self._units += units
        self._times_s.extend((now_s,) * min(units, _MOST_ARRIVALS))

    def rate_hz(self, now_s: float) -> float:
        """Units a second, over the last second or so; 0 when none came."""
        return self._hz if self._times_s and now_s - self._times_s[-1] < 2.0 else 0.0

    def jitter_s(self, now_s: float) -> float | None:
        """Spread of the time between units within the last 5 s: 99th percentile less median."""
        times_s = [each for each in self._times_s if now_s - each < _WINDOW_S]
        if len(times_s) <= _FEW:
            return None
        spans_s = sorted(later - earlier for earlier, later in pairwise(times_s))
        return spans_s[(len(spans_s) - 1) * 99 // 100] - spans_s[len(spans_s) // 2]


class LossCounter:
    """Units that never came: gaps in the controller's clock, where it beats regularly.

    Judged by twenty and more units at once, so that a unit told late is not taken for a lost one.

    Attributes:
        lost: So many, in all.
    """

    def __init__(self) -> None:
        self.lost = 0
        self._times_s: list[float] = []

    def forget(self) -> None:
        """What comes next is no continuation."""
        self._times_s.clear()

    def add(self, controller_time_s: float) -> None:
        """A unit came; of one that gives several events, each may say so."""
        times_s = self._times_s
        if times_s and not 0.0 <= controller_time_s - times_s[-1] < _LONGEST_GAP_S:
            times_s.clear()
        if not times_s or controller_time_s > times_s[-1]:
            times_s.append(controller_time_s)
            if len(times_s) > _FEW:
                self.lost += _missing(times_s)
                self._times_s = [controller_time_s]


def _missing(times_s: Sequence[float]) -> int:
    spans_s = [later - earlier for earlier, later in pairwise(times_s)]
    period_s = median(spans_s)
    regular = sum(abs(span - period_s) < 0.2 * period_s for span in spans_s)
    if regular < 0.75 * len(spans_s):
        return 0
    return max(0, int((times_s[-1] - times_s[0]) / period_s - len(spans_s) + 0.25))


class ResponseTimer:
    """How soon the controller shows that it got a command: a refusal, or a status that changes.

    Attributes:
        answer_s: After the last command that was answered within 2 s; None: none yet.
    """

    def __init__(self) -> None:
        self.answer_s: float | None = None
        self._sent_s: float | None = None
        self._status: StatusReceived | None = None

    def command_sent(self, now_s: float) -> None:
        """A command is on the socket."""
        self._sent_s = now_s

    def event_received(self, event: ControllerEvent, now_s: float) -> None:
        """The controller told something."""
        before = self._status
        if isinstance(event, StatusReceived):
            self._status = event
        if self._sent_s is None:
            return
        if isinstance(event, Refused) or (before and self._status and _said(before) != _said(self._status)):
            if now_s - self._sent_s < _ANSWERS_WITHIN_S:
                self.answer_s = now_s - self._sent_s
            self._sent_s = None


def _said(status: StatusReceived) -> tuple[object, ...]:
    return status.activity, status.mode, status.homed, status.trace
