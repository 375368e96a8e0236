"""Injection of faults that real controllers show; each can begin and end while the simulator runs.

Syntax: NAME, NAME@BEGIN, NAME+LENGTH or NAME@BEGIN+LENGTH, in seconds. A fault from the command line counts
from the first client's connection, a requested one from now. Their effects are pure functions.
"""

import itertools
import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

from protocol_gateway.core.records import AbsolutePositions, Command, Error, Record, Status, Velocities
from robomesh import reason_codes as codes
from services.simulator.errors import FaultError
from services.simulator.fault_table import COPIES, FAULTS, displacement
from services.simulator.unit_execution import FAULT, LOCAL, asks_to_stop

_TEXT = "drive of axis 1 overheated (simulated)"


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


# ------------------------------------------------------------------------ effects


def faulty_records(records: Sequence[Record], active: Collection[str], now_s: float) -> list[Record]:
    """Return a state's records as the active faults change them."""
    changed: list[Record] = []
    for record in records:
        match record:
            case AbsolutePositions(values):
                more = (0.0,) if "joints" in active else ()
                changed.append(
                    AbsolutePositions((values[0] + displacement(active, now_s), *values[1:], *more))
                )
            case _ if "bare" in active:
                pass
            case Velocities(values) if "joints" in active:
                changed.append(Velocities((*values, 0.0)))
            case Status(words):
                if "mute" not in active:
                    changed.append(Status(_words(words, active)))
            case _:
                changed.append(record)
    return changed


def _words(words: Sequence[str], active: Collection[str]) -> tuple[str, ...]:
    activity, mode, *flags = words
    return (
        "fault" if "fault" in active else activity,
        "local" if "local" in active else mode,
        *flags,
    )


def refusal(records: Sequence[Record], active: Collection[str]) -> Error | None:
    """Return the error record if an active fault forbids a client's unit, else None."""
    words = [word for record in records if isinstance(record, Command) for word in record.words]
    if asks_to_stop(records):
        return None
    if "local" in active:
        return Error(LOCAL, "local mode")
    if "fault" in active and "reset" not in words:
        return fault_error()
    return None


def fault_error() -> Error:
    """Return the record that reports the fault `fault`."""
    return Error(FAULT, _TEXT)


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


# One unit out of ten is malformed. Each entry breaks another rule and would pass a careless parser.
_EVERY = 10
_GARBAGE = (
    b"3#ABSOLUTE.DEG*1.00;2.00;3.00@",
    b"1#ABSOLUTE.DEG*90.00;9O.00;90.00;90.00;90.00@",
    b"1#ABSOLUTE.DEG*nan;nan;nan;nan;nan@",
    b"1#ABSOLUTE.DEG*1e999;0.00;0.00;0.00;0.00@",
    b"1#99999999999*1.00@",
    b"1#ABSOLUTE.DEG*10.00;20.\xb00;30.00;40.00;50.00@",
    b"#@",
    b"@",
    b"1#ABSOLUTE.DEG*10.00;20.1#ABSOLUTE.DEG*10.00;20.00;30.00;40.00;50.00@",
    b"\x00\xff\xfe\x1b[2J@",
)


def garbage() -> Iterator[bytes]:
    """Yield the bytes to send before each valid unit, mostly none."""
    for number in itertools.count():
        index, rest = divmod(number, _EVERY)
        yield b"" if rest else _GARBAGE[index % len(_GARBAGE)]
