"""Grammar of one unit: parser and formatter.

    unit    = count "#" record *( "&" record ) "@"      count = number of records, 1 or more
    record  = type [ "*" [ item *( ";" item ) ] ]       "usually two fields": the type may stand alone
    type    = name / int32
    item    = any ASCII characters but # * & ; @

Blanks (space, tab, CR, LF) around a count, a type or an item mean nothing.

Source: Chen, Zhang, Xue 2001, section 4. The prose calls the record separator "*", the example
uses "&": the example wins.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

from protocol_gateway.seam.errors import UnitError, UnitFormatError

TERMINATOR = b"@"
BLANKS = " \t\r\n"

_SEPARATORS = re.compile(r"[#*&;@]")
# The pattern is unambiguous, so that it rejects a long invalid text in linear time.
_NUMBER_TYPE = re.compile(r"([+-]?)[ \t\r\n]*([0-9]+)")
_INT32 = range(-(2**31), 2**31)


class RawRecord(NamedTuple):
    """A record as text, without surrounding blanks."""

    type: str
    items: tuple[str, ...] = ()


def parse_unit(data: bytes) -> tuple[RawRecord, ...]:
    """Parse the records of one unit.

    Args:
        data: The unit's bytes without the final "@".

    Raises:
        UnitError: If it is malformed; the text says how.
    """
    try:
        text = data.decode("ascii")
    except UnicodeDecodeError as error:
        raise UnitError(f"byte 0x{data[error.start]:02x} at {error.start} is outside ASCII") from None
    count, hash_sign, body = text.partition("#")
    if not hash_sign:
        raise UnitError("no '#' after a count of records")
    if "#" in body:
        raise UnitError("a second '#'")
    records = tuple([_parse_record(record) for record in body.split("&")])
    _check_count(count.strip(BLANKS), len(records))
    return records


def type_code(type_text: str) -> int | None:
    """Return a type's int32 code; None: the type is a name.

    Raises:
        UnitError: If it is a number outside int32.
    """
    # Fast path: most types are names, which do not end in a digit.
    if type_text[-1:] not in "0123456789" or not (match := _NUMBER_TYPE.fullmatch(type_text)):
        return None
    sign, digits = match[1], match[2].lstrip("0") or "0"
    # Ten digits are enough for int32; int() raises ValueError for thousands of digits.
    code = int(sign + digits) if len(digits) <= 10 else None
    # `None in range` would compare with each of the 2**32 numbers.
    if code is None or code not in _INT32:
        raise UnitError(f"type {type_text[:24]} is outside int32")
    return code


def format_unit(records: Sequence[RawRecord]) -> bytes:
    """Format a unit's bytes, with its "@", without blanks.

    Raises:
        UnitFormatError: If it has no record, or a text that would be parsed differently.
    """
    if not records:
        raise UnitFormatError("a unit has at least one record")
    return f"{len(records)}#{'&'.join(map(_format_record, records))}@".encode("ascii")


def plain_text(text: str) -> str:
    """Convert a text to one that an item can hold: ASCII, separators and line ends become blanks or "?"."""
    ascii_text = text.encode("ascii", "replace").decode("ascii")
    return " ".join(_SEPARATORS.sub(" ", ascii_text).split())


def _parse_record(text: str) -> RawRecord:
    type_text, star, data = text.partition("*")
    type_text = type_text.strip(BLANKS)
    if not type_text:
        raise UnitError("a record without a type")
    if "*" in data:
        raise UnitError(f"a second '*' in the record {_shortened(type_text)}")
    type_code(type_text)
    if not star or not data.strip(BLANKS):
        return RawRecord(type_text)
    return RawRecord(type_text, tuple([item.strip(BLANKS) for item in data.split(";")]))


def _check_count(count: str, records: int) -> None:
    if not count.isdecimal():
        raise UnitError(f"the count of records is {_shortened(count)!r}, not a number")
    # Compared as text, because int() raises ValueError for a count of thousands of digits.
    if (count.lstrip("0") or "0") != str(records):
        raise UnitError(f"the count says {_shortened(count)} records, there are {records}")


def _format_record(record: RawRecord) -> str:
    if not record.type:
        raise UnitFormatError("a record has a type")
    if record.items == ("",):
        raise UnitFormatError(f"record {record.type}: a single empty item reads like no item")
    for text in (record.type, *record.items):
        if not text.isascii() or text != text.strip(BLANKS) or _SEPARATORS.search(text):
            raise UnitFormatError(
                f"{text!r} is not allowed in a unit: use ASCII, no outer blanks, none of # * & ; @"
            )
    try:
        type_code(record.type)
    except UnitError as error:
        raise UnitFormatError(str(error)) from None
    return f"{record.type}*{';'.join(record.items)}" if record.items else record.type


def _shortened(text: str) -> str:
    return text if len(text) <= 24 else text[:24] + "…"
