"""How long something takes, each time: counts in a few steps, as Prometheus takes histograms."""

from bisect import bisect_left
from dataclasses import dataclass, field

STEPS_S = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)


@dataclass(slots=True)
class Latencies:
    """A histogram.

    Attributes:
        counts: Of those that took at most each of `STEPS_S`, and longer than the step before; then the rest.
        sum_s: Of all.
    """

    counts: list[int] = field(default_factory=lambda: [0] * (len(STEPS_S) + 1))
    sum_s: float = 0.0

    def add(self, seconds: float) -> None:
        """One more; a clock that was set back makes it 0."""
        self.counts[bisect_left(STEPS_S, seconds)] += 1
        self.sum_s += max(seconds, 0.0)

    def add_all(self, other: "Latencies") -> None:
        """All of another."""
        self.counts = [mine + more for mine, more in zip(self.counts, other.counts, strict=True)]
        self.sum_s += other.sum_s

    @property
    def count(self) -> int:
        """How many."""
        return sum(self.counts)
