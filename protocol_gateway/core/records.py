"""Typed records: what the records of a unit mean. Values stay in the file's units, degrees and millimetres.

| type | record | data |
|---|---|---|
| COMMAND | Command | words, done in order |
| ABSOLUTE.DEG, RELATIVE.DEG | AbsolutePositions, RelativePositions | one number a joint |
| VELOCITY.DEG | Velocities | one number a joint |
| STATUS | Status | words |
| ERROR | Error | a number and a text |
| TIME | Time | seconds |
| anything else | Unknown | as it came |
"""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from types import MappingProxyType
from typing import TypeAlias

from protocol_gateway.core import codes
from protocol_gateway.core.codes import CodeTable, Meaning
from protocol_gateway.core.grammar import RawRecord, format_unit, parse_unit, plain_text, type_code
from protocol_gateway.errors import UnitError, UnitFormatError

# Some controllers send "- 67.10", with a blank after the sign (Chen et al. 2001, section 4).
# There is one way only to read each text, so that a long wrong one is refused in linear time.
_NUMBER = re.compile(r"([+-]?)[ \t\r\n]*((?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)")
# Every finite double can be written within it, without an exponent.
_LONGEST_NUMBER = 400
_SPEED = re.compile(r"speed[ \t\r\n]*=[ \t\r\n]*(.*)", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Command:
    """Words, done in order; a speed is `speed=NN`. An unknown word is the receiver's to refuse."""

    words: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class AbsolutePositions:
    """One a joint [deg] or [mm]: where it is (from the controller), a target (from a client)."""

    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class RelativePositions:
    """One a joint [deg] or [mm], added to where it is."""

    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Velocities:
    """One a joint [deg/s] or [mm/s]."""

    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Status:
    """Words: `idle`, `remote`, `homed`, `trace`, ..."""

    words: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Error:
    """Answers a unit that was refused: 1 too many clients, 2 malformed, 3 unknown word, 4 joint count,
    5 limit, 6 local mode, 7 read only, 8 stopped, 9 fault."""

    number: int
    text: str


@dataclass(frozen=True, slots=True)
class Time:
    """The controller's own clock [s], for the records beside it."""

    seconds: float


@dataclass(frozen=True, slots=True)
class Unknown:
    """A type that nobody knows: kept, counted, published raw, never acted on."""

    type: str
    items: tuple[str, ...]


Record: TypeAlias = (
    Command | AbsolutePositions | RelativePositions | Velocities | Status | Error | Time | Unknown
)


def read_records(data: bytes, table: CodeTable = codes.NAMES) -> tuple[Record, ...]:
    """The typed records of one unit, all or none.

    Args:
        data: The unit's bytes up to its "@", without it.

    Raises:
        UnitError: If anything in it is malformed.
    """
    return tuple([_read(record, table) for record in parse_unit(data)])


def write_unit(records: Iterable[Record], table: CodeTable = codes.NAMES) -> bytes:
    """A unit's bytes, with its "@": codes where the table has them, else names.

    Raises:
        UnitFormatError: If a value cannot be written so that it is read as itself.
    """
    return format_unit([raw for record in records for raw in _write(record, table)])


def speed_percent(word: str) -> float | None:
    """The number of a `speed=NN` word; None: it is another word.

    Raises:
        UnitError: If what follows is not a finite number.
    """
    match = _SPEED.fullmatch(word)
    return read_number(match[1]) if match else None


def read_number(text: str) -> float:
    """A finite number, decimal or with an exponent.

    Raises:
        UnitError: If it is none.
    """
    match = _NUMBER.fullmatch(text) if len(text) <= _LONGEST_NUMBER else None
    value = float(match[1] + match[2]) if match else math.nan
    if not math.isfinite(value):
        raise UnitError(f"{text[:24]!r} is not a finite number")
    return value


def write_number(value: float) -> str:
    """A number as units hold it: two decimals, or as many more as it takes to be read as itself.

    Raises:
        UnitFormatError: If it is not finite.
    """
    if not math.isfinite(value):
        raise UnitFormatError(f"{value} is not a finite number")
    short = f"{value:.2f}"
    if float(short) == value:
        return short
    exact = repr(float(value))
    # The written form has no exponents: the paper's controllers print plain decimals.
    return format(Decimal(exact), "f") if "e" in exact else exact


# ------------------------------------------------------------------------ reading


def _numbers(items: Sequence[str]) -> tuple[float, ...]:
    if not items:
        raise UnitError("no numbers")
    return tuple([read_number(item) for item in items])


def _words(items: Sequence[str]) -> tuple[str, ...]:
    if not items or "" in items:
        raise UnitError("a word is missing")
    return tuple(items)


def _error(items: Sequence[str]) -> Error:
    number, *texts = items or ("",)
    if not re.fullmatch(r"[0-9]{1,9}", number):
        raise UnitError(f"error number {number[:24]!r} is not a number")
    return Error(int(number), "; ".join(texts))


def _time(items: Sequence[str]) -> Time:
    if len(items) != 1:
        raise UnitError(f"{len(items)} items, one is right")
    return Time(read_number(items[0]))


_READERS: Mapping[str, Callable[[Sequence[str]], Record]] = MappingProxyType(
    {
        codes.COMMAND: lambda items: Command(_words(items)),
        codes.ABSOLUTE: lambda items: AbsolutePositions(_numbers(items)),
        codes.RELATIVE: lambda items: RelativePositions(_numbers(items)),
        codes.VELOCITY: lambda items: Velocities(_numbers(items)),
        codes.STATUS: lambda items: Status(_words(items)),
        codes.ERROR: _error,
        codes.TIME: _time,
    }
)


def _read(record: RawRecord, table: CodeTable) -> Record:
    type_name, items = record
    word = None
    if (code := type_code(type_name)) is not None:
        type_name, word = table.meanings.get(code, Meaning(type_name))
    if (reader := _READERS.get(type_name)) is None:
        return Unknown(type_name, items)
    try:
        return _command(word, items) if word else reader(items)
    except UnitError as error:
        raise UnitError(f"{record.type}: {error}") from None


def _command(word: str, items: Sequence[str]) -> Command:
    """The command that a code stands for by itself; only a speed has a datum."""
    if word == "speed":
        if len(items) != 1:
            raise UnitError(f"{len(items)} items, one percentage is right")
        return Command((f"speed={items[0]}",))
    if items:
        raise UnitError(f"the code stands for {word!r}, which takes no data")
    return Command((word,))


# ------------------------------------------------------------------------ writing


def _write(record: Record, table: CodeTable) -> Iterable[RawRecord]:
    match record:
        case Command(words):
            return _write_command(words, table)
        case AbsolutePositions(values):
            return (_raw(codes.ABSOLUTE, map(write_number, values), table),)
        case RelativePositions(values):
            return (_raw(codes.RELATIVE, map(write_number, values), table),)
        case Velocities(values):
            return (_raw(codes.VELOCITY, map(write_number, values), table),)
        case Status(words):
            return (_raw(codes.STATUS, words, table),)
        case Error(number, text):
            # A text is for people: what an item cannot hold is left out rather than refused.
            plain = plain_text(text)
            return (_raw(codes.ERROR, (str(number), plain) if plain else (str(number),), table),)
        case Time(seconds):
            return (_raw(codes.TIME, (write_number(seconds),), table),)
        case Unknown(type_name, items):
            return (RawRecord(type_name, items),)


def _raw(type_name: str, items: Iterable[str], table: CodeTable) -> RawRecord:
    written = tuple(items)
    if not written:
        raise UnitFormatError(f"a record {type_name} has data")
    code = table.codes.get(Meaning(type_name))
    return RawRecord(type_name if code is None else str(code), written)


def _write_command(words: Sequence[str], table: CodeTable) -> Iterable[RawRecord]:
    """One record for all the words, or one each where a word has a code of its own."""
    own = [table.codes.get(Meaning(codes.COMMAND, word.partition("=")[0])) for word in words]
    if all(code is None for code in own):
        return (_raw(codes.COMMAND, words, table),)
    return [
        _raw(codes.COMMAND, (word,), table)
        if code is None
        else RawRecord(str(code), (word.partition("=")[2],) if "=" in word else ())
        for word, code in zip(words, own, strict=True)
    ]
