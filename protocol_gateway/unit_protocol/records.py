"""Typed records of a unit. Values stay in the protocol's units, degrees and millimetres.

| type | record | data |
|---|---|---|
| COMMAND | Command | words, done in order |
| ABSOLUTE.DEG, RELATIVE.DEG | AbsolutePositions, RelativePositions | one number a joint |
| VELOCITY.DEG | Velocities | one number a joint |
| STATUS | Status | words |
| ERROR | Error | a number and a text |
| TIME | Time | seconds |
| anything else | Unknown | as received |
"""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from types import MappingProxyType
from typing import TypeAlias

from protocol_gateway.seam.errors import UnitError, UnitFormatError
from protocol_gateway.unit_protocol import codes
from protocol_gateway.unit_protocol.codes import CodeTable, Meaning
from protocol_gateway.unit_protocol.grammar import RawRecord, format_unit, parse_unit, plain_text, type_code

# Some controllers send "- 67.10", with a blank after the sign (Chen et al. 2001, section 4).
# The pattern is unambiguous, so that it rejects a long invalid text in linear time.
_NUMBER = re.compile(r"([+-]?)[ \t\r\n]*((?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)")
# Enough for every finite double without an exponent.
_LONGEST_NUMBER = 400
_SPEED = re.compile(r"speed[ \t\r\n]*=[ \t\r\n]*(.*)", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Command:
    """Command words, executed in order; a speed is `speed=NN`. The receiver rejects unknown words."""

    words: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class AbsolutePositions:
    """Joint positions [deg] or [mm]: actual (from a controller) or target (from a client)."""

    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class RelativePositions:
    """Joint offsets [deg] or [mm] from the actual positions."""

    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Velocities:
    """Joint velocities [deg/s] or [mm/s]."""

    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Status:
    """Status words: `idle`, `remote`, `homed`, `trace`, ..."""

    words: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Error:
    """Answer to a rejected unit: 1 too many clients, 2 malformed, 3 unknown word, 4 joint count, 5 limit,
    6 local mode, 7 read only, 8 stopped, 9 fault."""

    number: int
    text: str


@dataclass(frozen=True, slots=True)
class Time:
    """Time of the unit's other records on the controller's clock [s]."""

    seconds: float


@dataclass(frozen=True, slots=True)
class Unknown:
    """A record of an unknown type: counted and published raw, without any effect."""

    type: str
    items: tuple[str, ...]


Record: TypeAlias = (
    Command | AbsolutePositions | RelativePositions | Velocities | Status | Error | Time | Unknown
)


def read_records(data: bytes, table: CodeTable = codes.NAMES) -> tuple[Record, ...]:
    """Parse the typed records of one unit, all or none.

    Args:
        data: The unit's bytes without the final "@".

    Raises:
        UnitError: If anything in it is malformed.
    """
    return tuple([_read(record, table) for record in parse_unit(data)])


def write_unit(records: Iterable[Record], table: CodeTable = codes.NAMES) -> bytes:
    """Format a unit's bytes, with its "@": codes where the table has them, otherwise names.

    Raises:
        UnitFormatError: If a value would be parsed differently.
    """
    return format_unit([raw for record in records for raw in _write(record, table)])


def asks_to_stop(records: Iterable[Record]) -> bool:
    """Return whether a unit holds a stop, which is executed for every client, even if the rest is refused."""
    return any(isinstance(record, Command) and "stop" in record.words for record in records)


def speed_percent(word: str) -> float | None:
    """Return the number of a `speed=NN` word; None: another word.

    Raises:
        UnitError: If the value is not a finite number.
    """
    match = _SPEED.fullmatch(word)
    return read_number(match[1]) if match else None


def read_number(text: str) -> float:
    """Parse a finite number, decimal or with an exponent.

    Raises:
        UnitError: If the text is not a finite number.
    """
    match = _NUMBER.fullmatch(text) if len(text) <= _LONGEST_NUMBER else None
    value = float(match[1] + match[2]) if match else math.nan
    if not math.isfinite(value):
        raise UnitError(f"{text[:24]!r} is not a finite number")
    return value


def write_number(value: float) -> str:
    """Format a number with two decimals, or with as many as are needed to parse the same value.

    Raises:
        UnitFormatError: If it is not finite.
    """
    if not math.isfinite(value):
        raise UnitFormatError(f"{value} is not a finite number")
    short = f"{value:.2f}"
    if float(short) == value:
        return short
    exact = repr(float(value))
    # Without an exponent, because the paper's controllers use plain decimals.
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
        raise UnitError(f"{len(items)} items, expected one")
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
    """Return the command that a code means; only a speed has a datum."""
    if word == "speed":
        if len(items) != 1:
            raise UnitError(f"{len(items)} items, expected one percentage")
        return Command((f"speed={items[0]}",))
    if items:
        raise UnitError(f"the code means {word!r}, which takes no data")
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
            # The text is for people, so unsupported characters are replaced instead of rejected.
            plain = plain_text(text)
            return (_raw(codes.ERROR, (str(number), plain) if plain else (str(number),), table),)
        case Time(seconds):
            return (_raw(codes.TIME, (write_number(seconds),), table),)
        case Unknown(type_name, items):
            return (RawRecord(type_name, items),)


def _raw(type_name: str, items: Iterable[str], table: CodeTable) -> RawRecord:
    written = tuple(items)
    if not written:
        raise UnitFormatError(f"a record {type_name} must have data")
    code = table.codes.get(Meaning(type_name))
    return RawRecord(type_name if code is None else str(code), written)


def _write_command(words: Sequence[str], table: CodeTable) -> Iterable[RawRecord]:
    """Return one record for all words, or one record a word if any word has its own code."""
    own = [table.codes.get(Meaning(codes.COMMAND, word.partition("=")[0])) for word in words]
    if all(code is None for code in own):
        return (_raw(codes.COMMAND, words, table),)
    return [
        _raw(codes.COMMAND, (word,), table)
        if code is None
        else RawRecord(str(code), (word.partition("=")[2],) if "=" in word else ())
        for word, code in zip(words, own, strict=True)
    ]
