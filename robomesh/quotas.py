"""Quotas: what one name may ask for of what costs others, so that nobody takes it all.

They go by the asker's name in the key, which the router vouches for; on a mesh without certificates by
whatever name somebody gives.
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
# When somebody who has as much as may be at once is to ask again [s].
_AGAIN_S = 0.5
_ROUNDING_S = 1e-6
# Askers that are remembered: who is forgotten has its whole minute's worth again.
_MOST_ASKERS = 4096


@dataclass(frozen=True, kw_only=True)
class Quotas:
    """What each name may ask for: `[quotas]` of the site file.

    Attributes:
        views: Of one's own, at once at one renderer; and as large a share of what is drawn for all.
        key_frames_a_minute: That one renderer makes because of it.
        checks: Of programs, at once at one kinematics service.
        checks_a_minute: Of one kinematics service.
        recordings_mib_a_minute: Of answers from one recorder: files, messages, values.
    """

    views: int = 16
    key_frames_a_minute: float = 240.0
    checks: int = 2
    checks_a_minute: float = 120.0
    recordings_mib_a_minute: float = 4096.0


DEFAULT_QUOTAS = Quotas()


class Quota:
    """One of them, counted by asker; for one event loop.

    A minute's worth may come at once, and then as much as time gives back: a leaky bucket as a meter, in
    its form of one number an asker (GCRA, ITU-T I.371, annex A).

    Args:
        name: Of its keys in the site file.
        at_once: How many may be under way.
        a_minute: How much may be asked for.
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
        # When everything that somebody had is given back by time, on the clock [s].
        self._even_at: dict[str, float] = {}

    @contextmanager
    def one(self, asker: str) -> Iterator[None]:
        """One is under way for as long as the block lasts.

        Raises:
            QuotaError: If that is more than the asker may have.
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
            self._under_way += Counter()  # forgets who has none

    def check(self, asker: str, amount: float = 0.0) -> None:
        """Whether so much is left for somebody; anything at all, where how much it is shows afterwards.

        Raises:
            QuotaError: If not; says when there will be.
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
        """Count what somebody was given."""
        now = self._clock()
        if asker not in self._even_at and len(self._even_at) >= _MOST_ASKERS:
            self._forget(now)
        self._even_at[asker] = max(self._even_at.get(asker, now), now) + amount * _MINUTE_S / self._a_minute

    def _forget(self, now: float) -> None:
        """Forget who is even; if nobody is, whoever had least."""
        owing = {asker: at for asker, at in self._even_at.items() if at > now}
        if len(owing) >= _MOST_ASKERS:
            del owing[min(owing, key=owing.__getitem__)]
        self._even_at = owing
