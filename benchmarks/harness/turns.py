"""Measurements that take turns, so that other load on the machine affects all of them, and their spread."""

import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

K = TypeVar("K")
T = TypeVar("T")


def in_turns(measures: Mapping[K, Callable[[], T]], rounds: int) -> dict[K, list[T]]:
    """Return the results of each measurement; every second round runs in the reverse order."""
    found: dict[K, list[T]] = {name: [] for name in measures}
    for number in range(rounds):
        for name in [*measures][:: 1 if number % 2 == 0 else -1]:
            found[name].append(measures[name]())
    return found


def spread(values: Sequence[float]) -> dict[str, float]:
    """Return the median, the least and the most."""
    return {"median": statistics.median(values), "least": min(values), "most": max(values)}


def percentile(values: Sequence[float], percent: int) -> float:
    """Return a value that this share of the values does not exceed; NaN without values."""
    ordered = sorted(values)
    return ordered[min(len(ordered) * percent // 100, len(ordered) - 1)] if ordered else math.nan


def summary(durations_ns: Sequence[float]) -> dict[str, float]:
    """Return the number, the median, the 99th percentile and the spread [ms] of durations [ns]."""
    values = [each / 1e6 for each in durations_ns] or [math.nan]
    return {
        "n": len(durations_ns),
        "p50": statistics.median(values),
        "p99": percentile(values, 99),
        "min": min(values),
        "max": max(values),
    }
