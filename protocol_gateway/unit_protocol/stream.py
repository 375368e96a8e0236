"""Parser of a byte stream into units, however the bytes are split.

    between units --bytes--> in a unit --"@"--> Unit or Malformed, between units
    in a unit --64 KiB without "@"--> Malformed, lost --"@"--> between units

A malformed unit affects nothing before its first byte or after its "@".
"""

from collections.abc import Collection
from dataclasses import dataclass
from typing import TypeAlias

from protocol_gateway.seam.errors import UnitError
from protocol_gateway.unit_protocol import codes
from protocol_gateway.unit_protocol.codes import CodeTable
from protocol_gateway.unit_protocol.grammar import TERMINATOR
from protocol_gateway.unit_protocol.plain import plain_readers, read_plain
from protocol_gateway.unit_protocol.records import Record, read_records

LONGEST_UNIT_BYTES = 64 * 1024
"""Most bytes of a unit, including its "@"."""

_LONGEST_TEXT = 256


@dataclass(frozen=True, slots=True)
class Unit:
    """A well-formed unit.

    Attributes:
        records: In the order of execution.
        data: The unit's bytes without the final "@".
        offset: Position of its first byte in the stream.
    """

    records: tuple[Record, ...]
    data: bytes
    offset: int


@dataclass(frozen=True, slots=True)
class Malformed:
    """Bytes that are not a valid unit; nothing in them is executed.

    Attributes:
        offset: Position of their first byte in the stream.
        text: The first 256 bytes, printable.
        reason: Description of the error.
    """

    offset: int
    text: str
    reason: str


StreamEvent: TypeAlias = Unit | Malformed


class UnitStream:
    """Parser of one direction of one connection."""

    def __init__(self, table: CodeTable = codes.NAMES) -> None:
        self._table = table
        self._plain = plain_readers(table)
        self._buffer = bytearray()
        self._offset = 0  # of the buffer's first byte
        self._lost = False  # after 64 KiB without "@": skip to the next "@"

    def receive(self, data: bytes, containing: Collection[bytes] | None = None) -> list[StreamEvent]:
        """Return the events of the next bytes, independent of how the bytes are split.

        Args:
            containing: Skip units that contain none of these, without parsing them.
        """
        *ends, rest = data.split(TERMINATOR)
        events: list[StreamEvent] = []
        for end in ends:
            unit = end
            if self._buffer:
                unit = bytes(self._buffer) + end
                self._buffer.clear()
            if self._lost:
                self._lost = False
            elif containing is None or any(each in unit for each in containing):
                events.append(self._unit(unit, self._offset))
            self._offset += len(unit) + 1
        self._buffer += rest
        if len(self._buffer) >= LONGEST_UNIT_BYTES:
            if not self._lost:
                events.append(self._too_long(bytes(self._buffer), self._offset))
                self._lost = True
            self._offset += len(self._buffer)
            self._buffer.clear()
        return events

    def _unit(self, data: bytes, offset: int) -> StreamEvent:
        if len(data) >= LONGEST_UNIT_BYTES:
            return self._too_long(data, offset)
        try:
            records = read_plain(data, self._plain) or read_records(data, self._table)
            return Unit(records, data, offset)
        except UnitError as error:
            return Malformed(offset, printable(data), str(error))

    def _too_long(self, data: bytes, offset: int) -> Malformed:
        return Malformed(offset, printable(data), f"not ended within {LONGEST_UNIT_BYTES} bytes")


def printable(data: bytes) -> str:
    """Convert the first 256 bytes from a peer to text that is safe to print."""
    text = data[:_LONGEST_TEXT].decode("ascii", "backslashreplace")
    shown = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)
    return shown + "…" if len(data) > _LONGEST_TEXT else shown
