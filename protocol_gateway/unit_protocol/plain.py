"""Fast parser for common units: known types, plain decimals, lower-case words.

It accepts only what the grammar accepts, with the same result. Everything else, malformed or merely
unusual, is left to the grammar. It is several times as fast, because it parses a whole record at a time.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from protocol_gateway.unit_protocol import codes
from protocol_gateway.unit_protocol.codes import CodeTable, Meaning
from protocol_gateway.unit_protocol.grammar import BLANKS
from protocol_gateway.unit_protocol.records import (
    AbsolutePositions,
    Record,
    RelativePositions,
    Status,
    Time,
    Velocities,
)

Reader = Callable[[bytes], Record | None]

_BLANKS = BLANKS.encode()
_DECIMALS = b"0123456789.-;" + _BLANKS
_LETTERS = b"abcdefghijklmnopqrstuvwxyz;"
# Shorter than any decimal that overflows to infinity (309 digits).
_LONGEST_DATA = 300


def plain_readers(table: CodeTable) -> Mapping[bytes, Reader]:
    """Return the reader of each type's data, by the bytes of its name and of its code."""
    numbers = {str(code): meaning for code, meaning in table.meanings.items()}
    names = {name: Meaning(name) for name in _READERS}
    return {
        text.encode(): _READERS[meaning.type]
        for text, meaning in (names | numbers).items()
        if meaning.word is None and meaning.type in _READERS
    }


def read_plain(data: bytes, readers: Mapping[bytes, Reader]) -> tuple[Record, ...] | None:
    """Parse a plain unit; None: it is not plain, or malformed."""
    count, _, body = data.partition(b"#")
    parts = body.split(b"&")
    if count.strip(_BLANKS) != b"%d" % len(parts):
        return None
    records = []
    for part in parts:
        type_text, _, items = part.partition(b"*")
        reader = readers.get(type_text.strip(_BLANKS))
        record = reader(items) if reader else None
        if record is None:
            return None
        records.append(record)
    return tuple(records)


def _numbers(items: bytes) -> tuple[float, ...] | None:
    # With these characters, float() accepts what the grammar accepts, except the paper's "- 67.10".
    if len(items) > _LONGEST_DATA or items.translate(None, _DECIMALS):
        return None
    try:
        return tuple(map(float, items.replace(b"- ", b"-").split(b";")))
    except ValueError:
        return None


def _row(kind: Callable[[tuple[float, ...]], Record]) -> Reader:
    def read(items: bytes) -> Record | None:
        values = _numbers(items)
        return None if values is None else kind(values)

    return read


def _time(items: bytes) -> Record | None:
    values = _numbers(items)
    return None if values is None or len(values) != 1 else Time(values[0])


def _status(items: bytes) -> Record | None:
    if items.translate(None, _LETTERS):
        return None
    words = tuple(items.decode("ascii").split(";"))
    return None if "" in words else Status(words)


_READERS: Mapping[str, Reader] = MappingProxyType(
    {
        codes.ABSOLUTE: _row(AbsolutePositions),
        codes.RELATIVE: _row(RelativePositions),
        codes.VELOCITY: _row(Velocities),
        codes.STATUS: _status,
        codes.TIME: _time,
    }
)
