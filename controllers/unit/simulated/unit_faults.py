"""Effects of faults on units. They are pure functions."""

import itertools
from collections.abc import Collection, Iterator, Sequence

from controllers.simulated.fault_table import displacement
from controllers.unit.simulated.execution import FAULT, LOCAL
from protocol_gateway.unit_protocol.records import (
    AbsolutePositions,
    Command,
    Error,
    Record,
    Status,
    Velocities,
    asks_to_stop,
)

_TEXT = "drive of axis 1 overheated (simulated)"


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
