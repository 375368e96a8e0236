"""Faults that a real controller shows, on purpose: each begun and ended while it runs.

NAME, NAME@BEGIN, NAME+LENGTH or NAME@BEGIN+LENGTH, in seconds: of the command line after the first
client came, of a request from now. What the faults do is a function of records, names and time.
"""

import itertools
import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

from protocol_gateway.core.records import AbsolutePositions, Command, Error, Record, Status, Velocities
from services.simulator.errors import SimulatorError
from services.simulator.fault_table import COPIES, FAULTS, LEAP
from services.simulator.unit_execution import FAULT, LOCAL, asks_to_stop

_TEXT = "drive of axis 1 overheated (simulated)"


@dataclass(frozen=True)
class Span:
    """A fault and when it is there [s], from a beginning that is told elsewhere."""

    name: str
    begin_s: float
    length_s: float


def parse_fault(text: str, *, begin_s: float | None = None) -> Span:
    """What NAME, NAME@BEGIN, NAME+LENGTH or NAME@BEGIN+LENGTH means.

    Args:
        begin_s: When it begins unless said; None: as its row says.

    Raises:
        SimulatorError: If there is no such fault, or these are no such times.
    """
    head, plus, length = text.partition("+")
    name, at, begin = head.partition("@")
    row = FAULTS.get(name)
    if row is None:
        raise SimulatorError(f"fault {text[:80]!r} is unknown; there are {', '.join(FAULTS)}")
    try:
        span = Span(
            name,
            float(begin) if at else row.begin_s if begin_s is None else begin_s,
            float(length) if plus else row.length_s,
        )
    except ValueError:
        span = Span(name, math.nan, math.nan)
    if not (0.0 <= span.begin_s < math.inf and span.length_s > 0.0):
        raise SimulatorError(
            f"fault {text[:80]!r}: NAME@BEGIN+LENGTH is right, both in seconds, as in {name}@2.5+10"
        )
    return span


class Faults:
    """Which faults there are when.

    Args:
        texts: Of the command line: their time begins when the first client comes.

    Raises:
        SimulatorError: If one is none.
    """

    def __init__(self, texts: Sequence[str]) -> None:
        self._waiting = [parse_fault(text) for text in texts]
        self._spans: dict[str, Span] = {}

    def first_client(self, now_s: float) -> None:
        """A client has come; the first one starts the clock of those that wait."""
        for span in self._waiting:
            self._spans[span.name] = replace(span, begin_s=now_s + span.begin_s)
        self._waiting = []

    def begin(self, text: str, now_s: float) -> None:
        """Begin a fault, at once unless it says otherwise.

        Raises:
            SimulatorError: If there is no such fault.
        """
        span = parse_fault(text, begin_s=0.0)
        self._spans[span.name] = replace(span, begin_s=now_s + span.begin_s)

    def end(self, text: str) -> None:
        """End a fault, if it is there.

        Raises:
            SimulatorError: If there is no such fault.
        """
        name = parse_fault(text).name
        self._spans.pop(name, None)
        self._waiting = [span for span in self._waiting if span.name != name]

    def active(self, now_s: float) -> frozenset[str]:
        """The names of those that are there now."""
        return frozenset(
            name for name, span in self._spans.items() if 0.0 <= now_s - span.begin_s < span.length_s
        )


# ------------------------------------------------------------------------ what they do


def disguised(records: Sequence[Record], active: Collection[str], now_s: float) -> list[Record]:
    """What is told in place of a state's records."""
    told: list[Record] = []
    for record in records:
        match record:
            case AbsolutePositions(values):
                leap = LEAP if "jump" in active and int(now_s) % 2 else 0.0
                more = (0.0,) if "joints" in active else ()
                told.append(AbsolutePositions((values[0] + leap, *values[1:], *more)))
            case _ if "bare" in active:
                pass
            case Velocities(values) if "joints" in active:
                told.append(Velocities((*values, 0.0)))
            case Status(words):
                if "mute" not in active:
                    told.append(Status(_words(words, active)))
            case _:
                told.append(record)
    return told


def _words(words: Sequence[str], active: Collection[str]) -> tuple[str, ...]:
    activity, mode, *flags = words
    return (
        "fault" if "fault" in active else activity,
        "local" if "local" in active else mode,
        *flags,
    )


def refusal(records: Sequence[Record], active: Collection[str]) -> Error | None:
    """The answer to a client's unit that a fault forbids; None: it forbids nothing."""
    words = [word for record in records if isinstance(record, Command) for word in record.words]
    if asks_to_stop(records):
        return None
    if "local" in active:
        return Error(LOCAL, "local mode")
    if "fault" in active and "reset" not in words:
        return fault_error()
    return None


def fault_error() -> Error:
    """What a controller says of its fault."""
    return Error(FAULT, _TEXT)


def copies(active: Collection[str]) -> int:
    """How many times each unit is sent."""
    return max((count for name, count in COPIES.items() if name in active), default=1)


def pieces(unit: bytes) -> Iterator[bytes]:
    """A unit cut into pieces of 1, 2, 3, 5, 7 and 97 bytes."""
    begin = 0
    for size in itertools.cycle((1, 2, 3, 5, 7, 97)):
        if begin >= len(unit):
            return
        yield unit[begin : begin + size]
        begin += size


# A unit out of ten, each refused for a reason of its own, each taken as a good one by a careless reader.
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
    """What goes before each good unit: mostly nothing."""
    for number in itertools.count():
        index, rest = divmod(number, _EVERY)
        yield b"" if rest else _GARBAGE[index % len(_GARBAGE)]
