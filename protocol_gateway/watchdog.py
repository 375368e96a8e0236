"""Whether what beat has ceased to beat. No I/O; time is an argument."""

STALE_S = 3.0
"""Without a beat for this long, what it told is not known any more."""

_REPEATS = 3


class Watchdog:
    """Sees something that is told again and again, and whether that ends.

    A controller that tells its status on change only is silent for hours, and nothing is wrong with it:
    only one that was seen to repeat itself, unchanged and within 3 s, three times in a row, is waited for.
    """

    def __init__(self) -> None:
        self._last_value: object = None
        self._last_s = float("-inf")
        self._repeats = 0

    def reset(self, value: object, time_s: float) -> None:
        """Something was value, at a monotonic time."""
        if self._repeats < _REPEATS:
            again = value == self._last_value and time_s - self._last_s < STALE_S
            self._repeats = self._repeats + 1 if again else 0
        self._last_value, self._last_s = value, time_s

    def expired(self, now_s: float) -> bool:
        """Whether it beat once, and does no more."""
        return self._repeats >= _REPEATS and now_s - self._last_s >= STALE_S
