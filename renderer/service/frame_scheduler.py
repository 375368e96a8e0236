"""Choice of the next view to draw, and of anti-aliasing, on a machine that may be too slow for all views.

There is no queue: the view that has waited longest is drawn next, from the robot's current state. On a slow
machine all rates fall evenly at first; then anti-aliasing is turned off until there is time for it again.
All times are on one monotonic clock [s].
"""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

_WINDOW_S = 2.0
# Loads, as shares of the available time.
_TOO_MUCH, _ENOUGH_ROOM, _FINE_AGAIN = 1.15, 0.8, 1.05
_COARSE_AFTER_S, _FINE_AFTER_S, _REPORT_AFTER_S = 2.0, 5.0, 5.0
# Half the interval of `frames`: one message of a moving robot arrives within it before or after any time.
_NEAR_S = 1.0 / 120.0
# Time of a picture with anti-aliasing over time without, until it is measured.
_USUAL_COST = 2.0


class Due(Protocol):
    """A view that is drawn repeatedly."""

    @property
    def due_at(self) -> float:
        """Time at which it is due."""


AnyDue = TypeVar("AnyDue", bound=Due)


def next_view(views: Iterable[AnyDue], now: float) -> tuple[AnyDue | None, float]:
    """Return the view that has waited longest, None if none is due yet, and when the next is due."""
    soonest = min(views, key=lambda view: view.due_at, default=None)
    if soonest is None:
        return None, math.inf
    return (soonest if soonest.due_at <= now else None), soonest.due_at


def due_with_placements(due_at: float, moved_at: float) -> float:
    """Return when to draw a view, so that it shows placements that have just arrived.

    A picture at its exact time would show placements of half their interval before, in the mean.

    Args:
        due_at: Time of the view's next picture at its rate.
        moved_at: Time at which the newest placements arrived.
    """
    return due_at - _NEAR_S if moved_at >= due_at - _NEAR_S else due_at + _NEAR_S


def next_due(due_at: float, now: float, interval_s: float) -> float:
    """Return when a view that is drawn now is due again; missed pictures are not made up for."""
    return max(due_at + interval_s, now) if now - due_at < interval_s else now + interval_s


@dataclass
class _ConditionTimer:
    """A timer of how long a condition has held."""

    since: float | None = None

    def seconds(self, holds: bool, now: float) -> float:
        if not holds:
            self.since = None
            return 0.0
        self.since = now if self.since is None else self.since
        return now - self.since


@dataclass
class FrameScheduler:
    """Measurements of the drawing rate, and the decisions that follow.

    Attributes:
        coarse: Draw without anti-aliasing.
        slow: The machine has drawn fewer pictures than wanted for some time.
        cost: Time of a picture with anti-aliasing over time without.
    """

    coarse: bool = False
    slow: bool = False
    cost: float = _USUAL_COST
    _drawn: deque[tuple[float, float]] = field(default_factory=deque)
    _fine_took: float | None = None
    _overloaded: _ConditionTimer = field(default_factory=_ConditionTimer)
    _roomy: _ConditionTimer = field(default_factory=_ConditionTimer)
    _behind: _ConditionTimer = field(default_factory=_ConditionTimer)
    _caught_up: _ConditionTimer = field(default_factory=_ConditionTimer)

    def record(self, now: float, took_s: float, *, wanted_hz: float) -> None:
        """Record a drawn picture, and update `coarse` and `slow`.

        Args:
            took_s: Time until the next picture could begin.
            wanted_hz: Wanted rate of pictures, of all views together.
        """
        self._drawn.append((now, took_s))
        while self._drawn[0][0] < now - _WINDOW_S:
            self._drawn.popleft()
        mean = self._mean()
        load = wanted_hz * mean
        if self.coarse:
            self._learn_cost(mean)
            if self._roomy.seconds(load * self.cost < _ENOUGH_ROOM, now) >= _FINE_AFTER_S:
                self._become(coarse=False)
        elif self._overloaded.seconds(load > _TOO_MUCH, now) >= _COARSE_AFTER_S:
            self._fine_took = mean
            self._become(coarse=True)
        if self._behind.seconds(load > _TOO_MUCH, now) >= _REPORT_AFTER_S:
            self.slow = True
        if self._caught_up.seconds(load < _FINE_AGAIN, now) >= _REPORT_AFTER_S:
            self.slow = False

    def rate_hz(self, now: float) -> float:
        """Return the current rate of drawn pictures [1/s]."""
        recent = sum(at >= now - _WINDOW_S for at, _ in self._drawn)
        return recent / _WINDOW_S

    def reset(self) -> None:
        """Reset, because no view has subscribers."""
        self._drawn.clear()
        self._become(coarse=False)
        self.slow = False
        self._behind, self._caught_up = _ConditionTimer(), _ConditionTimer()

    def _become(self, *, coarse: bool) -> None:
        self.coarse = coarse
        self._drawn.clear()
        self._overloaded, self._roomy = _ConditionTimer(), _ConditionTimer()

    def _mean(self) -> float:
        return sum(took for _, took in self._drawn) / max(len(self._drawn), 1)

    def _learn_cost(self, mean: float) -> None:
        # Once, when there are enough pictures without anti-aliasing to compare.
        if self._fine_took is not None and len(self._drawn) >= 20:
            self.cost = min(max(self._fine_took / mean, 1.2), 4.0)
            self._fine_took = None
