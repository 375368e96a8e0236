"""Health of a link: rate, jitter, lost units, response time. No I/O.

Times are seconds on the gateway's monotonic clock, unless named as the controller's.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median

import numpy as np

from protocol_gateway.link.timestamping import EventTime
from protocol_gateway.seam import ControllerEvent, Refused, StatusReceived

_WINDOW_S = 5.0
_MOST_ARRIVALS = 512
_FEW = 20
_ANSWERS_WITHIN_S = 2.0
_LONGEST_GAP_S = 60.0  # of the controller's clock; a longer gap means that the clock was set


@dataclass(frozen=True, slots=True)
class LinkHealth:
    """Health values, as in `robomesh.LinkHealth`; None: unknown."""

    jitter_s: float | None
    network_round_trip_s: float | None
    answer_s: float | None
    stamp_uncertainty_s: float | None


class Arrivals:
    """Receive times of units."""

    def __init__(self) -> None:
        self._times_s: deque[float] = deque(maxlen=_MOST_ARRIVALS)
        self._begin_s = 0.0
        self._units = 0
        self._hz = 0.0

    def count(self, units: int, now_s: float) -> None:
        """Add units of one read."""
        elapsed_s = now_s - self._begin_s
        if elapsed_s >= 1.0:
            # After a pause the rate is unknown.
            self._hz = self._units / elapsed_s if elapsed_s < 2.0 else 0.0
            self._begin_s, self._units = now_s, 0
        self._units += units
        self._times_s.extend((now_s,) * min(units, _MOST_ARRIVALS))

    def rate_hz(self, now_s: float) -> float:
        """Return units a second, over about the last second; 0 if there were none."""
        return self._hz if self._times_s and now_s - self._times_s[-1] < 2.0 else 0.0

    def jitter_s(self, now_s: float) -> float | None:
        """Return the jitter of unit intervals within the last 5 s: 99th percentile minus median."""
        times_s = np.array(self._times_s)
        spans_s = np.sort(np.diff(times_s[now_s - times_s < _WINDOW_S]))
        if len(spans_s) < _FEW:
            return None
        return float(spans_s[(len(spans_s) - 1) * 99 // 100] - spans_s[len(spans_s) // 2])


class AnswerTimes:
    """Times between questions and their answers, of a controller that is asked for its state.

    The state is of some moment between the two, so the middle is wrong by at most half of it.
    """

    def __init__(self) -> None:
        self._halves_s: deque[tuple[float, float]] = deque(maxlen=_MOST_ARRIVALS)

    def answered(self, asked_s: float, now: EventTime) -> EventTime:
        """Return the time stamp of an answer that was received now."""
        half_s = max(0.0, now.monotonic_s - asked_s) / 2
        self._halves_s.append((now.monotonic_s, half_s))
        return EventTime(now.monotonic_s - half_s, now.wall_ns - round(half_s * 1e9), now.clock)

    def stamp_uncertainty_s(self, now_s: float) -> float | None:
        """Return the greatest uncertainty of stamps within the last 5 s; None: nothing was asked."""
        return max((half for at_s, half in self._halves_s if now_s - at_s < _WINDOW_S), default=None)


class LossCounter:
    """Counter of lost units: gaps in a controller clock that is otherwise regular.

    It evaluates twenty and more units at a time, so that a delayed unit does not count as lost.

    Attributes:
        lost: Number of lost units so far.
    """

    def __init__(self) -> None:
        self.lost = 0
        self._times_s: list[float] = []

    def forget(self) -> None:
        """Discard the times, because the next unit does not continue them."""
        self._times_s.clear()

    def add(self, controller_time_s: float) -> None:
        """Add a unit's time; several events of one unit may repeat it."""
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
    """Timer of the controller's response to a command: a refusal, or a changed status.

    Attributes:
        answer_s: Response time of the last command that was answered within 2 s; None: none yet.
    """

    def __init__(self) -> None:
        self.answer_s: float | None = None
        self._sent_s: float | None = None
        self._status: StatusReceived | None = None

    def command_sent(self, now_s: float) -> None:
        """Start the timer when a command is on the socket."""
        self._sent_s = now_s

    def event_received(self, event: ControllerEvent, now_s: float) -> None:
        """Stop the timer if an event answers the command."""
        before = self._status
        if isinstance(event, StatusReceived):
            self._status = event
        if self._sent_s is None:
            return
        if isinstance(event, Refused) or (before and self._status and before.values != self._status.values):
            if now_s - self._sent_s < _ANSWERS_WITHIN_S:
                self.answer_s = now_s - self._sent_s
            self._sent_s = None
