"""What one client may send: a token bucket each for its bytes and its units. No I/O; time is an argument.

bucket not empty --spend--> read on
bucket empty     --spend--> read no more until it is half full again
as many such pauses as last for the patience --> the client sends too much
"""

from dataclasses import dataclass

# A pause that comes so soon after the one before belongs to the same flood.
_SAME_FLOOD_S = 1.0


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a client may send.

    Attributes:
        burst_s: It may be ahead by what it could send in this time.
        patience_s: It may be over its limits for this long, its reading paused.
    """

    units_per_s: float = 200.0
    bytes_per_s: float = 64.0 * 1024
    burst_s: float = 2.0
    patience_s: float = 5.0


class Budget:
    """What one client may send now."""

    def __init__(self, limits: Limits, now_s: float) -> None:
        self._limits = limits
        # In seconds of the allowed rate: one bucket is for both kinds what two would be.
        self._units_s = self._bytes_s = limits.burst_s
        self._filled_s = now_s
        self._resumed_s = float("-inf")
        self._over_since_s: float | None = None

    def spend(self, *, units: int, length: int, now_s: float) -> float:
        """Pay for what came; for how long nothing more is to be read [s].

        Args:
            length: In bytes.
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
        """Whether the client has been over its limits for too long; to be asked when it is paused."""
        return self._over_since_s is not None and now_s - self._over_since_s >= self._limits.patience_s
