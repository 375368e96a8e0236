"""Latency histograms in Prometheus's form: counts in a few steps."""

from bisect import bisect_left
from dataclasses import dataclass, field

STEPS_S = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)


@dataclass(slots=True)
class Latencies:
    """A histogram.

    Attributes:
        counts: Number of values up to each of `STEPS_S` and above the step before; last, those above all.
        sum_s: Sum of all values.
    """

    counts: list[int] = field(default_factory=lambda: [0] * (len(STEPS_S) + 1))
    sum_s: float = 0.0

    def add(self, seconds: float) -> None:
        """Add a value; a negative one, after the clock was set back, adds 0 to the sum."""
        self.counts[bisect_left(STEPS_S, seconds)] += 1
        self.sum_s += max(seconds, 0.0)

    def add_all(self, other: "Latencies") -> None:
        """Add all values of another histogram."""
        self.counts = [mine + more for mine, more in zip(self.counts, other.counts, strict=True)]
        self.sum_s += other.sum_s

    @property
    def count(self) -> int:
        """Number of values."""
        return sum(self.counts)
