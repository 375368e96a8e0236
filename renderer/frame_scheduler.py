"""Which view is drawn next, and how well, on a machine that may not keep up with all that is watched.

Nothing is queued: who waits longest is drawn next, from what is so then. When the machine cannot keep
up, first the rate falls, fairly; then anti-aliasing goes, and comes back when there is time for it.
All times on one monotonic clock [s].
"""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

_WINDOW_S = 2.0
# Of the time there is, so much would be needed.
_TOO_MUCH, _ENOUGH_ROOM, _FINE_AGAIN = 1.15, 0.8, 1.05
_COARSE_AFTER_S, _FINE_AFTER_S, _TOLD_AFTER_S = 2.0, 5.0, 5.0
# How much longer a picture takes with anti-aliasing, as long as nobody measured it.
_USUAL_COST = 2.0


class Due(Protocol):
    """Something that is drawn now and then."""

    @property
    def due_at(self) -> float:
        """From when on it is to be drawn."""


AnyDue = TypeVar("AnyDue", bound=Due)


def next_of(views: Iterable[AnyDue], now: float) -> tuple[AnyDue | None, float]:
    """The view that has waited longest, or none yet; and when the next is due."""
    soonest = min(views, key=lambda view: view.due_at, default=None)
    if soonest is None:
        return None, math.inf
    return (soonest if soonest.due_at <= now else None), soonest.due_at


def next_due(due_at: float, now: float, interval_s: float) -> float:
    """When a view that is drawn now is due again: it keeps its beat, but makes up for nothing."""
    return max(due_at + interval_s, now) if now - due_at < interval_s else now + interval_s


@dataclass
class _Lasting:
    """How long something has been so."""

    since: float | None = None

    def seconds(self, holds: bool, now: float) -> float:
        if not holds:
            self.since = None
            return 0.0
        self.since = now if self.since is None else self.since
        return now - self.since


@dataclass
class Pace:
    """What the machine does and should do.

    Attributes:
        coarse: Pictures are drawn without anti-aliasing.
        slow: For a while now, fewer pictures are drawn than are watched.
    """

    coarse: bool = False
    slow: bool = False
    cost: float = _USUAL_COST
    _drawn: deque[tuple[float, float]] = field(default_factory=deque)
    _fine_took: float | None = None
    _overloaded: _Lasting = field(default_factory=_Lasting)
    _roomy: _Lasting = field(default_factory=_Lasting)
    _behind: _Lasting = field(default_factory=_Lasting)
    _caught_up: _Lasting = field(default_factory=_Lasting)

    def drew(self, now: float, took_s: float, *, wanted_hz: float) -> None:
        """A picture was made.

        Args:
            took_s: Until the next one could be begun.
            wanted_hz: Pictures that are to be made a second, of all views.
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
        if self._behind.seconds(load > _TOO_MUCH, now) >= _TOLD_AFTER_S:
            self.slow = True
        if self._caught_up.seconds(load < _FINE_AGAIN, now) >= _TOLD_AFTER_S:
            self.slow = False

    def rate_hz(self, now: float) -> float:
        """Pictures a second that are made now."""
        recent = sum(at >= now - _WINDOW_S for at, _ in self._drawn)
        return recent / _WINDOW_S

    def rested(self) -> None:
        """Nobody watches."""
        self._drawn.clear()
        self._become(coarse=False)
        self.slow = False
        self._behind, self._caught_up = _Lasting(), _Lasting()

    def _become(self, *, coarse: bool) -> None:
        self.coarse = coarse
        self._drawn.clear()
        self._overloaded, self._roomy = _Lasting(), _Lasting()

    def _mean(self) -> float:
        return sum(took for _, took in self._drawn) / max(len(self._drawn), 1)

    def _learn_cost(self, mean: float) -> None:
        # Once, when there are enough pictures of the new kind to compare.
        if self._fine_took is not None and len(self._drawn) >= 20:
            self.cost = min(max(self._fine_took / mean, 1.2), 4.0)
            self._fine_took = None
