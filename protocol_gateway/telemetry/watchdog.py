"""Watchdog for values that repeat. No I/O; time is an argument."""

STALE_S = 3.0
"""A repeating value is unknown after this long without a repetition."""
SLOW_STALE_S = 6.0
"""The same for the status of a controller that is read slowly (`Capabilities.slow_hz`)."""

_REPEATS = 3


class Watchdog:
    """Watchdog that expires when a repeating value stops.

    A controller that reports its status only on change may be silent for hours. Therefore the watchdog is
    armed only after three repetitions in a row, unchanged and each within the time.

    Args:
        stale_s: Time without a repetition after which the value is unknown.
    """

    def __init__(self, stale_s: float = STALE_S) -> None:
        self._stale_s = stale_s
        self._last_value: object = None
        self._last_s = float("-inf")
        self._repeats = 0

    def reset(self, value: object, time_s: float) -> None:
        """Restart the watchdog with a value received at a monotonic time."""
        if self._repeats < _REPEATS:
            again = value == self._last_value and time_s - self._last_s < self._stale_s
            self._repeats = self._repeats + 1 if again else 0
        self._last_value, self._last_s = value, time_s

    def expired(self, now_s: float) -> bool:
        """Return whether the value repeated, and has stopped."""
        return self._repeats >= _REPEATS and now_s - self._last_s >= self._stale_s
