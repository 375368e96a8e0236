"""This machine's wall clock as its monotonic clock plus an offset, which changes only when the clock is set.

NTP and PTP slew both clocks alike. A reading brackets the offset: monotonic, wall, monotonic. A process
that loses the processor in between gets a wider bracket and never a wrong one, so times of two processes
of one machine can be compared: `earliest_ns` of one is never after `latest_ns` of another at one moment.
"""

import time

# Smaller steps of the wall clock begin no new identity. A step back counts sooner than one forward: stamps
# that follow each other closely would change order.
_SET_FORWARD_NS, _SET_BACK_NS = 1_000_000, 1_000
_FIRST_READINGS = 30


class WallClock:
    """The wall clock at times of the monotonic clock; for one thread at a time."""

    def __init__(self) -> None:
        readings = [_bracket() for _ in range(_FIRST_READINGS)]
        self._least_ns, self._most_ns = min(readings, key=lambda reading: reading[1] - reading[0])

    def was_set(self) -> bool:
        """Return whether the wall clock was set since the last call: 1 ms forward or 1 µs back, at least."""
        least_ns, most_ns = _bracket()
        if least_ns <= self._most_ns and self._least_ns <= most_ns:
            self._least_ns, self._most_ns = max(self._least_ns, least_ns), min(self._most_ns, most_ns)
            return False
        forward_ns, back_ns = least_ns - self._most_ns, self._least_ns - most_ns
        self._least_ns, self._most_ns = least_ns, most_ns
        return forward_ns >= _SET_FORWARD_NS or back_ns >= _SET_BACK_NS

    def earliest_ns(self, monotonic_ns: int) -> int:
        """Return the wall clock at a monotonic time, ns since the Unix epoch; never too late."""
        return monotonic_ns + self._least_ns

    def latest_ns(self, monotonic_ns: int) -> int:
        """Return the wall clock at a monotonic time, ns since the Unix epoch; never too early."""
        return monotonic_ns + self._most_ns


def _bracket() -> tuple[int, int]:
    """Bounds of what the wall clock is ahead of the monotonic one [ns]."""
    before_ns = time.monotonic_ns()
    wall_ns = time.time_ns()
    return wall_ns - time.monotonic_ns(), wall_ns - before_ns
