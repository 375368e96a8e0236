"""When data was new. What a cable or a sleeping process held back must not be dated as if it were fresh.

TCP delivers everything: after a gap of seconds the units of all that time come in a burst. Where
the controller tells its own clock, the burst can be told from news:

    expected = when the last fresh unit came + how far the controller's clock has gone since
    late     = now - expected

Only what comes within a second after a gap is looked at like this, so neither a drifting or stuck
clock nor one that was set can make live data look old for longer.

Of what comes without a clock nobody can say how old it is: of a burst after a gap, the newest alone is new.
"""

from dataclasses import dataclass

# Arrivals further apart than this leave room for something held back.
_GAP_S = 0.25
# How long a burst may last: it comes as fast as the network can.
_BURST_S = 1.0
_TOLERANCE_S = 0.1
# A live stream without pauses must not be taken for a burst for longer.
_LONGEST_HOLD_S = 0.25


@dataclass(frozen=True, slots=True)
class Received:
    """When an event was new here.

    Attributes:
        monotonic_s: On the gateway's monotonic clock: for ages.
        wall_ns: On the gateway's wall clock, ns since the Unix epoch: the stamp of what is published.
    """

    monotonic_s: float
    wall_ns: int


class Dating:
    """Dates of one connection's events."""

    def __init__(self) -> None:
        self._fresh: tuple[float, Received] | None = None
        self._arrived_s = float("inf")
        self._gap_end_s = float("-inf")

    def after_gap(self, now_s: float) -> bool:
        """Whether what comes may have been held back, and the newest of it is still to come."""
        return now_s - self._gap_end_s < _LONGEST_HOLD_S

    def date(self, controller_time_s: float | None, now: Received) -> Received:
        """When an event that has just been read was new: now, or earlier when it was held back.

        Args:
            controller_time_s: The controller's clock beside it; None: it tells none, so now it is.
            now: When its bytes were read.
        """
        if now.monotonic_s - self._arrived_s > _GAP_S:
            self._gap_end_s = now.monotonic_s
        self._arrived_s = now.monotonic_s
        if controller_time_s is None:
            return now
        if self._fresh is not None and now.monotonic_s - self._gap_end_s < _BURST_S:
            fresh_time_s, fresh = self._fresh
            late_s = now.monotonic_s - fresh.monotonic_s - (controller_time_s - fresh_time_s)
            if late_s > _TOLERANCE_S and controller_time_s > fresh_time_s:
                return Received(now.monotonic_s - late_s, now.wall_ns - int(late_s * 1e9))
        self._fresh = (controller_time_s, now)
        return now
