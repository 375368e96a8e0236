"""The wall clock as the monotonic clock plus an offset, which changes only when the wall clock is set.

NTP and PTP slew both clocks alike. A reading brackets the offset: monotonic, wall, monotonic. If the process
is suspended during a reading, the bracket gets wider but stays correct. So times of two processes on one
machine can be compared: at any moment `earliest_ns` of one is not after `latest_ns` of another.
"""

import time

# Smaller steps of the wall clock are ignored. The limit for steps back is lower, because they can change the
# order of two close timestamps.
_SET_FORWARD_NS, _SET_BACK_NS = 1_000_000, 1_000
_READINGS = 30


class WallClock:
    """Wall clock times from monotonic times; for one thread at a time."""

    def __init__(self) -> None:
        self._least_ns, self._most_ns = _narrow_bracket()

    def was_set(self) -> bool:
        """Return whether the wall clock was set since the last call, at least 1 ms forward or 1 µs back."""
        least_ns, most_ns = _bracket()
        if least_ns <= self._most_ns and self._least_ns <= most_ns:
            self._least_ns, self._most_ns = max(self._least_ns, least_ns), min(self._most_ns, most_ns)
            return False
        forward_ns, back_ns = least_ns - self._most_ns, self._least_ns - most_ns
        # The bracket of a suspended reading is wide: with it times would go back by the suspension.
        self._least_ns, self._most_ns = _narrow_bracket()
        return forward_ns >= _SET_FORWARD_NS or back_ns >= _SET_BACK_NS

    def earliest_ns(self, monotonic_ns: int) -> int:
        """Return the lower bound of the wall clock at a monotonic time, ns since the Unix epoch."""
        return monotonic_ns + self._least_ns

    def latest_ns(self, monotonic_ns: int) -> int:
        """Return the upper bound of the wall clock at a monotonic time, ns since the Unix epoch."""
        return monotonic_ns + self._most_ns


class ForwardClock:
    """The wall clock, except that it never goes back: a date that has passed stays passed.

    While the wall clock is behind an earlier reading, the time goes on with the monotonic clock.
    """

    def __init__(self) -> None:
        self._latest_s, self._read_s = time.time(), time.monotonic()

    def now_s(self) -> float:
        """Return the time since the Unix epoch [s]."""
        # In this order, a suspension between the readings does not put the time ahead.
        wall_s, read_s = time.time(), time.monotonic()
        self._latest_s = max(wall_s, self._latest_s + read_s - self._read_s)
        self._read_s = read_s
        return self._latest_s


def _narrow_bracket() -> tuple[int, int]:
    """Return the narrowest of several brackets."""
    return min((_bracket() for _ in range(_READINGS)), key=lambda bracket: bracket[1] - bracket[0])


def _bracket() -> tuple[int, int]:
    """Return bounds of the wall clock minus the monotonic clock [ns]."""
    before_ns = time.monotonic_ns()
    wall_ns = time.time_ns()
    return wall_ns - time.monotonic_ns(), wall_ns - before_ns
