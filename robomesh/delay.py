"""How late a sample comes: what waited on its way is as old as it is, and not new because it has come now.

A line that is cut for a moment, or full, gives old samples out together afterwards. Clocks of two
machines cannot be compared, but the lags of one publisher's samples can, each with the least of them:
whatever lies between the clocks is the same in all of them. Nobody is believed alone: a least lag is what
two samples, one after the other, do not exceed, so that a single one dated ahead makes no other late. The
first is, because the second may have waited, but not for longer than anything can.
"""

from dataclasses import dataclass

from robomesh.header import Header

# Clocks part, by at most 500 ppm while one is being set: so the least lag may grow a little faster than
# that, but not over a silence: what comes first after it may have waited.
_DRIFT = 1e-3
_MOST_GROWN_S = 1.0
# A connection that carries nothing for 2 s is given up, with what waited there. A second sample that is
# later than this tells that the first was dated ahead.
_MOST_WAITED_S = 10.0


@dataclass(slots=True)
class Lateness:
    """Of one publisher's samples; another publisher of the same key begins anew."""

    publisher: int | None = None
    least_lag_s: float = 0.0
    last_lag_s: float = 0.0
    taken_s: float = 0.0
    alone: bool = True

    def of(self, header: Header, now_s: float) -> float:
        """How much longer a sample was on its way than the quickest before it [s].

        Args:
            now_s: On the receiver's monotonic clock, any origin.
        """
        if not header.source_time_ns:
            return 0.0  # its publisher does not tell
        lag_s = now_s - header.source_time_ns * 1e-9
        if header.publisher != self.publisher:
            self.publisher, self.least_lag_s, self.alone = header.publisher, lag_s, True
            self.last_lag_s, self.taken_s = lag_s, now_s
            return 0.0
        grown_s = min(max(now_s - self.taken_s, 0.0), _MOST_GROWN_S) * _DRIFT
        least_s, of_two_s = self.least_lag_s + grown_s, max(lag_s, self.last_lag_s)
        dated_ahead = self.alone and lag_s - least_s > _MOST_WAITED_S
        self.least_lag_s = of_two_s if dated_ahead else min(least_s, of_two_s)
        self.last_lag_s, self.taken_s, self.alone = lag_s, now_s, False
        return max(lag_s - self.least_lag_s, 0.0)
