"""Rate limit of one client: a token bucket each for its bytes and its units. No I/O; time is an argument.

bucket not empty --spend--> continue reading
bucket empty     --spend--> pause until it is half full again
pauses for longer than the patience --> the client is a flood
"""

from dataclasses import dataclass

# A pause that follows the previous one this soon belongs to the same flood.
_SAME_FLOOD_S = 1.0


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Rate limits of a client.

    Attributes:
        burst_s: Size of the buckets, as time at the allowed rate.
        patience_s: A client that exceeds its limits for this long is a flood.
    """

    units_per_s: float = 200.0
    bytes_per_s: float = 64.0 * 1024
    burst_s: float = 2.0
    patience_s: float = 5.0


class Budget:
    """Token buckets of one client."""

    def __init__(self, limits: Limits, now_s: float) -> None:
        self._limits = limits
        # Both in seconds at the allowed rate, so that they can be compared.
        self._units_s = self._bytes_s = limits.burst_s
        self._filled_s = now_s
        self._resumed_s = float("-inf")
        self._over_since_s: float | None = None

    def spend(self, *, units: int, length: int, now_s: float) -> float:
        """Spend tokens for received data; return how long to pause reading [s].

        Args:
            length: Number of bytes.
        """
        limits, passed_s = self._limits, now_s - self._filled_s
        self._filled_s = now_s
        self._units_s = min(self._units_s + passed_s, limits.burst_s) - units / limits.units_per_s
        self._bytes_s = min(self._bytes_s + passed_s, limits.burst_s) - length / limits.bytes_per_s
        left_s = min(self._units_s, self._bytes_s)
        if left_s >= 0:
            return 0.0
        if now_s - self._resumed_s > _SAME_FLOOD_S:
            self._over_since_s = now_s
        pause_s = limits.burst_s / 2 - left_s
        self._resumed_s = now_s + pause_s
        return pause_s

    def is_flood(self, now_s: float) -> bool:
        """Return whether the client has exceeded its limits for too long; call it while paused."""
        return self._over_since_s is not None and now_s - self._over_since_s >= self._limits.patience_s
