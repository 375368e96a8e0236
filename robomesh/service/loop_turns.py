"""Durations of the event loop's turns: all other work of the process waits for the end of one, also stops."""

import asyncio
import math
import selectors
import time
from collections.abc import Callable

LONG_S = 0.05
"""A turn that takes longer is reported with what ran."""
OTHER = "other work"
# Shorter turns, and parts of one, are not noted: the measurement takes 0.5 us a turn.
_SHORT_S = 0.001
_WINDOW_S = 30.0
_now_s = time.monotonic


class LoopTurns:
    """Measurement of one event loop.

    Attributes:
        begin_s: Begin of the current turn (monotonic).
        long_turns: Number of turns that took longer than `LONG_S`.
        on_long: Callback for a long turn, called in the next one: duration [s] and cause. The cause is that
            of a part with at least half of the duration, or `OTHER`.
    """

    def __init__(self) -> None:
        self.begin_s = math.inf
        self.long_turns = 0
        self.on_long: Callable[[float, object], None] = lambda took_s, cause: None
        self._part_s = _SHORT_S
        self._part: object = OTHER
        self._longest_s = self._before_s = 0.0
        self._window_s = _now_s()

    def ran(self, cause: object, since_s: float) -> None:
        """Note the cause of a part of the turn that began at a time (monotonic) and ends now."""
        took_s = _now_s() - since_s
        if took_s > self._part_s:
            self._part_s, self._part = took_s, cause

    def end(self, took_s: float) -> None:
        """Note a turn that was not short, before the loop waits for events."""
        self._longest_s = max(self._longest_s, took_s)
        if took_s > LONG_S:
            self._report(took_s)
        self._part_s, self._part = _SHORT_S, OTHER

    def longest_s(self) -> float:
        """Return the longest turn of the last 30 to 60 s; 0: all took less than 1 ms."""
        now_s = _now_s()
        if now_s - self._window_s > _WINDOW_S:
            self._before_s = self._longest_s if now_s - self._window_s < 2 * _WINDOW_S else 0.0
            self._longest_s, self._window_s = 0.0, now_s
        return max(self._longest_s, self._before_s)

    def _report(self, took_s: float) -> None:
        self.long_turns += 1
        cause = self._part if self._part_s >= took_s / 2 else OTHER
        # Not called here, because the loop has already determined how long it waits.
        asyncio.get_running_loop().call_soon_threadsafe(self.on_long, took_s, cause)


class MeasuredLoop(asyncio.SelectorEventLoop):
    """An event loop that measures its turns, from the end of one wait for events to the begin of the next."""

    def __init__(self) -> None:
        self.turns = LoopTurns()
        super().__init__(_Selector(self.turns))


class _Selector(selectors.DefaultSelector):
    def __init__(self, turns: LoopTurns) -> None:
        super().__init__()
        self._turns = turns

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        turns = self._turns
        took_s = _now_s() - turns.begin_s
        if took_s > _SHORT_S:
            turns.end(took_s)
        ready = super().select(timeout)
        turns.begin_s = _now_s()
        return ready


def turns_of(loop: asyncio.AbstractEventLoop) -> LoopTurns:
    """Return the measurement of an event loop; of one that does not measure, one that stays empty."""
    return loop.turns if isinstance(loop, MeasuredLoop) else LoopTurns()
