"""Injection of faults that real controllers show; each can begin and end while the simulator runs.

Syntax: NAME, NAME@BEGIN, NAME+LENGTH or NAME@BEGIN+LENGTH, in seconds. A fault from the command line counts
from the first client's connection, a requested one from now. Their effects are pure functions.
"""

import itertools
import logging
import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

from controllers.simulated.errors import FaultError
from controllers.simulated.fault_table import COPIES, FAULTS
from robomesh import reason_codes as codes

logger = logging.getLogger(__name__)

_DROP_EACH_S = 1.0


@dataclass(frozen=True)
class Span:
    """A fault with its begin and length [s], relative to a start that the caller knows."""

    name: str
    begin_s: float
    length_s: float


def parse_fault(text: str, *, begin_s: float | None = None, known: Collection[str] = FAULTS.keys()) -> Span:
    """Parse NAME, NAME@BEGIN, NAME+LENGTH or NAME@BEGIN+LENGTH.

    Args:
        begin_s: Default begin; None for the default of the fault's row.
        known: Names of the faults that the controller can show.

    Raises:
        FaultError: If the fault is unknown, or a time is invalid.
    """
    head, plus, length = text.partition("+")
    name, at, begin = head.partition("@")
    if name not in known:
        raise FaultError(codes.FAULT_UNKNOWN(name=text[:80], names=", ".join(known)))
    row = FAULTS[name]
    try:
        span = Span(
            name,
            float(begin) if at else row.begin_s if begin_s is None else begin_s,
            float(length) if plus else row.length_s,
        )
    except ValueError:
        span = Span(name, math.nan, math.nan)
    if not (0.0 <= span.begin_s < math.inf and span.length_s > 0.0):
        raise FaultError(codes.FAULT_TIMES(given=text[:80], name=name))
    return span


class Faults:
    """Schedule of the faults.

    Args:
        texts: Faults of the command line; their time starts with the first client's connection.
        known: Names of the faults that the controller can show.

    Raises:
        FaultError: If one is invalid.
    """

    def __init__(self, texts: Sequence[str], *, known: Collection[str] = FAULTS.keys()) -> None:
        self.known = known
        self._waiting = [parse_fault(text, known=known) for text in texts]
        self._spans: dict[str, Span] = {}
        self._shown: set[Span] = set()
        self._dropped_s = 0.0

    def first_client(self, now_s: float) -> None:
        """Start the time of the waiting faults; later calls have no effect."""
        for span in self._waiting:
            self._spans[span.name] = replace(span, begin_s=now_s + span.begin_s)
        self._waiting = []

    def begin(self, text: str, now_s: float) -> None:
        """Begin a fault now, or at its @BEGIN.

        Raises:
            FaultError: If it is invalid.
        """
        span = parse_fault(text, begin_s=0.0, known=self.known)
        self._spans[span.name] = replace(span, begin_s=now_s + span.begin_s)

    def end(self, text: str) -> None:
        """End a fault, if it is active or waiting.

        Raises:
            FaultError: If it is unknown.
        """
        name = parse_fault(text, known=self.known).name
        self._spans.pop(name, None)
        self._waiting = [span for span in self._waiting if span.name != name]

    def active(self, now_s: float) -> frozenset[str]:
        """Return the names of the active faults."""
        return frozenset(
            name for name, span in self._spans.items() if 0.0 <= now_s - span.begin_s < span.length_s
        )

    def changes(
        self, before: frozenset[str], now_s: float
    ) -> tuple[frozenset[str], frozenset[str], frozenset[str]]:
        """Return the active faults, and which have begun and ended since others were; log these.

        A fault that is over before a busy machine looks is active for one look.
        """
        begun_by_now = {each for each in self._spans.values() if each.begin_s <= now_s}
        active = self.active(now_s) | {each.name for each in begun_by_now - self._shown}
        self._shown = begun_by_now
        begun, ended = active - before, before - active
        for name in begun:
            logger.warning("fault: %s, %s", name, FAULTS[name].effect)
        for name in ended:
            logger.warning("fault %s is over", name)
        return active, begun, ended

    def drops(self, now_s: float) -> bool:
        """Return whether the fault "drop" closes all connections now, which it does each second."""
        if "drop" not in self.active(now_s) or now_s - self._dropped_s < _DROP_EACH_S:
            return False
        self._dropped_s = now_s
        return True


# ------------------------------------------------------------------------ effects


def copies(active: Collection[str]) -> int:
    """Return how many times each unit is sent."""
    return max((count for name, count in COPIES.items() if name in active), default=1)


def pieces(unit: bytes) -> Iterator[bytes]:
    """Yield a unit in pieces of 1, 2, 3, 5, 7 and 97 bytes."""
    begin = 0
    for size in itertools.cycle((1, 2, 3, 5, 7, 97)):
        if begin >= len(unit):
            return
        yield unit[begin : begin + size]
        begin += size
