"""Packages with a length in their header, in a stream that is split anywhere.

RTDE and the primary interface have headers of the same form: the package's length in bytes, which includes
the header, and its type. Neither marks where a package begins, so a stream with an invalid length is lost:
only a new connection helps.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from protocol_gateway.driver_parts.hexadecimal import hexadecimal


@dataclass(frozen=True, slots=True)
class Package:
    """A complete package.

    Attributes:
        type: Type in the header.
        payload: Bytes after the header.
        offset: Position of its first byte in the connection's stream.
    """

    type: int
    payload: bytes
    offset: int


@dataclass(frozen=True, slots=True)
class Malformed:
    """Bytes that are not a valid package; nothing in them was used.

    Attributes:
        offset: Position of their first byte in the connection's stream.
        text: The first bytes in hexadecimal.
        reason: Description of the error.
        fatal: The stream cannot be read any further; everything after these bytes is discarded.
    """

    offset: int
    text: str
    reason: str
    fatal: bool = False


PackageEvent: TypeAlias = Package | Malformed


class PackageStream:
    """Splitter of one direction of one connection into packages.

    Args:
        header: Format of the header for `struct`: length, then type.
        longest: Greatest length of a package [bytes]; a longer one is malformed.
        skip: Returns whether packages of a type are discarded as they arrive, without a buffer.
        longest_skipped: Greatest length of a discarded package [bytes].

    Attributes:
        skipped: Number of discarded packages.
        lost: A length was invalid, so everything after it is discarded.
    """

    def __init__(
        self,
        header: str,
        *,
        longest: int,
        skip: Callable[[int], bool] | None = None,
        longest_skipped: int = 0,
    ) -> None:
        self._header = struct.Struct(header)
        self._longest = longest
        self._skips = skip
        self._longest_skipped = longest_skipped
        self._buffer = bytearray()
        self._offset = 0  # of the buffer's first byte
        self._to_skip = 0
        self.skipped = 0
        self.lost = False

    def receive(self, data: bytes) -> list[PackageEvent]:
        """Return the packages that these bytes complete, independent of how the bytes are split."""
        events: list[PackageEvent] = []
        if self.lost:
            return events
        self._buffer += data
        begin = 0
        while True:
            begin += self._skip(len(self._buffer) - begin)
            rest = len(self._buffer) - begin
            if rest < self._header.size or self._to_skip:
                break
            length, kind = self._header.unpack_from(self._buffer, begin)
            skips = self._skips is not None and self._skips(kind)
            longest = self._longest_skipped if skips else self._longest
            if not self._header.size <= length <= longest:
                events.append(self._lose(begin, length, kind, longest))
                return events
            if skips:
                self._to_skip = length
                self.skipped += 1
                continue
            if rest < length:
                break
            payload = bytes(self._buffer[begin + self._header.size : begin + length])
            events.append(Package(kind, payload, self._offset + begin))
            begin += length
        del self._buffer[:begin]
        self._offset += begin
        return events

    def _skip(self, available: int) -> int:
        """Return how many of the next bytes belong to a discarded package."""
        count = min(self._to_skip, available)
        self._to_skip -= count
        return count

    def _lose(self, begin: int, length: int, kind: int, longest: int) -> Malformed:
        reason = (
            f"a package of type {kind} announces {length} bytes: "
            f"must be {self._header.size} to {longest}; the rest of the connection cannot be read"
        )
        text = hexadecimal(self._buffer[begin : begin + self._header.size])
        event = Malformed(self._offset + begin, text, reason, fatal=True)
        self.lost = True
        self._buffer.clear()
        return event
