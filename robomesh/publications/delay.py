"""Delay of received samples: a sample that waited on its way counts as old when it arrives.

A line that was interrupted or full delivers old samples together afterwards. The clocks of two machines
cannot be compared, but the lags (arrival minus source time) of one publisher's samples can: the difference
of the clocks is the same in all of them. So a sample's delay is its lag minus the least lag. The least lag
is one that two consecutive samples do not exceed, so that a single sample dated in the future makes no
other sample late. The first sample's lag counts without a second, because the second may have waited; but
if the second lags by more than the longest possible wait, the first was dated in the future.
"""

from dataclasses import dataclass

from robomesh.contract.header import Header

# Clocks drift apart, by at most 500 ppm while one is being slewed, so the least lag may grow slightly
# faster. It does not grow over a pause: the first sample after a pause may have waited.
_DRIFT = 1e-3
_MOST_GROWN_S = 1.0
# Longest wait of a sample. A connection without traffic for 2 s is closed, and what waited there is lost.
_MOST_WAITED_S = 10.0


@dataclass(slots=True)
class Delay:
    """The delay of one publisher's samples; starts over when another publisher uses the key.

    Attributes:
        is_first: The least lag comes from a single sample.
    """

    publisher: int | None = None
    least_lag_s: float = 0.0
    last_lag_s: float = 0.0
    taken_s: float = 0.0
    is_first: bool = True

    def of(self, header: Header, now_s: float) -> float:
        """Return how much longer a sample took than the quickest one before it [s].

        Args:
            now_s: Arrival on the receiver's monotonic clock, any origin.
        """
        if not header.source_time_ns:
            return 0.0  # the publisher sends no source time
        lag_s = now_s - header.source_time_ns * 1e-9
        if header.publisher != self.publisher:
            self.publisher, self.least_lag_s, self.is_first = header.publisher, lag_s, True
            self.last_lag_s, self.taken_s = lag_s, now_s
            return 0.0
        grown_s = min(max(now_s - self.taken_s, 0.0), _MOST_GROWN_S) * _DRIFT
        least_s, of_two_s = self.least_lag_s + grown_s, max(lag_s, self.last_lag_s)
        dated_ahead = self.is_first and lag_s - least_s > _MOST_WAITED_S
        self.least_lag_s = of_two_s if dated_ahead else min(least_s, of_two_s)
        self.last_lag_s, self.taken_s, self.is_first = lag_s, now_s, False
        return max(lag_s - self.least_lag_s, 0.0)
