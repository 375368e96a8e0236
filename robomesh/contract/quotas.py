"""Quotas: limits for each caller on requests that cost shared resources.

They count by the caller's name in the key. With certificates the router checks that name; without them a
program may use any name.
"""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from robomesh import reason_codes as codes
from robomesh.errors import QuotaError

_MINUTE_S = 60.0
# Wait after a request over the parallel limit [s].
_AGAIN_S = 0.5
_ROUNDING_S = 1e-6
# Callers that are remembered; a forgotten one has its full quota again.
_MOST_ASKERS = 4096


@dataclass(frozen=True, kw_only=True)
class Quotas:
    """Limits for each name: `[quotas]` of the site file.

    Attributes:
        views: Requested views in parallel at one renderer; also limits the caller's share of its pixels.
        key_frames_a_minute: Key frames that a caller requests from one renderer.
        checks: Program checks in parallel at one kinematics service.
        checks_a_minute: Program checks at one kinematics service.
        recordings_mib_a_minute: Answers from one recorder [MiB]: files, messages, values.
        program_saves_a_minute: Changes of stored programs and layouts.
        notes_a_minute: Notes that are written or withdrawn.
        cell_changes_a_minute: Changes of cells at one gateway, and trials of changes.
    """

    views: int = 16
    key_frames_a_minute: float = 240.0
    checks: int = 2
    checks_a_minute: float = 120.0
    recordings_mib_a_minute: float = 4096.0
    program_saves_a_minute: float = 120.0
    notes_a_minute: float = 60.0
    cell_changes_a_minute: float = 60.0


DEFAULT_QUOTAS = Quotas()


class Quota:
    """One quota, counted for each caller; for one event loop.

    A caller may use a minute's amount in a burst; it then refills with time. This is a leaky bucket as a
    meter, with one number for each caller (GCRA, ITU-T I.371, annex A).

    Args:
        name: Name of its keys in the site file.
        at_once: Most requests in parallel.
        a_minute: Amount a minute.
    """

    def __init__(
        self,
        name: str,
        *,
        a_minute: float,
        at_once: float = math.inf,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._name, self._a_minute, self._at_once, self._clock = name, a_minute, at_once, clock
        self._under_way = Counter[str]()
        # Time at which a caller's quota is full again, on the clock [s].
        self._even_at: dict[str, float] = {}

    @contextmanager
    def in_progress(self, asker: str) -> Iterator[None]:
        """Count one request, in progress until the block ends.

        Raises:
            QuotaError: If the caller's quota does not allow it.
        """
        if self._under_way[asker] >= self._at_once:
            reason = codes.QUOTA_AT_ONCE(
                asker=asker,
                count=self._under_way[asker],
                quota=self._name,
                most=self._at_once,
                seconds=_AGAIN_S,
            )
            raise QuotaError(reason, again_s=_AGAIN_S)
        self.check(asker, 1.0)
        self.count(asker, 1.0)
        self._under_way[asker] += 1
        try:
            yield
        finally:
            self._under_way[asker] -= 1
            self._under_way += Counter()  # removes callers at zero

    def check(self, asker: str, amount: float = 0.0) -> None:
        """Check that a caller's quota covers an amount; 0 checks that any is left, if the amount is unknown.

        Raises:
            QuotaError: If it does not; says when it will.
        """
        now = self._clock()
        owed_s = max(self._even_at.get(asker, now) - now, 0.0)
        again_s = owed_s + amount * _MINUTE_S / self._a_minute - _MINUTE_S
        if again_s > _ROUNDING_S:
            reason = codes.OVER_QUOTA(
                asker=asker,
                quota=f"{self._name}_a_minute",
                most=self._a_minute,
                seconds=max(again_s, 0.1),
            )
            raise QuotaError(reason, again_s=again_s)

    def count(self, asker: str, amount: float) -> None:
        """Charge an amount to a caller."""
        now = self._clock()
        if asker not in self._even_at and len(self._even_at) >= _MOST_ASKERS:
            self._forget(now)
        self._even_at[asker] = max(self._even_at.get(asker, now), now) + amount * _MINUTE_S / self._a_minute

    def _forget(self, now: float) -> None:
        """Forget the callers with a full quota; if there is none, the one that used least."""
        owing = {asker: at for asker, at in self._even_at.items() if at > now}
        if len(owing) >= _MOST_ASKERS:
            del owing[min(owing, key=owing.__getitem__)]
        self._even_at = owing
