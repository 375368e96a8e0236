"""The chunks of a 3DS file.

chunk = id:uint16 length:uint32 data        length includes these 6 bytes; little-endian
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robots.schema.errors import ShapeError

_HEADER = struct.Struct("<HI")


@dataclass(frozen=True)
class Chunk:
    """One chunk's id and the bytes of its data, from `start` to before `end`."""

    id: int
    start: int
    end: int


@dataclass(frozen=True)
class Source:
    """A file's bytes, and the warnings about them."""

    path: Path
    data: bytes
    warnings: list[str] = field(default_factory=list)

    def chunks(self, start: int, end: int, *, lenient: bool = False) -> Iterator[Chunk]:
        """Yield the consecutive chunks between two bytes.

        Args:
            lenient: Cut a chunk that is too long, with a warning, instead of raising. Some programs write
                wrong lengths for the outermost chunks, although the content is complete.

        Raises:
            ShapeError: If a chunk is longer than its container; the error has the byte.
        """
        while end - start >= _HEADER.size:
            identity, length = _HEADER.unpack_from(self.data, start)
            problem = f"chunk {identity:04X} has {length} bytes; {end - start} are left"
            if length < _HEADER.size:
                if not lenient:
                    raise self.error(start, problem)
                self.warn(f"byte {start}: {problem}; the rest is left out")
                return
            stop = start + length
            if stop > end:
                if not lenient:
                    raise self.error(start, problem)
                self.warn(f"byte {start}: {problem}; read to the end")
                stop = end
            yield Chunk(identity, start + _HEADER.size, stop)
            start = stop

    def text(self, start: int, end: int) -> tuple[str, int]:
        """Return a string that ends with a zero byte, and the position after it."""
        zero = self.data.find(b"\0", start, end)
        if zero < 0:
            raise self.error(start, "a name does not end with a zero byte")
        return self.data[start:zero].decode("latin-1"), zero + 1

    def array(self, start: int, end: int, kind: str, width: int) -> tuple[NDArray[np.float64], int]:
        """Return the rows of a list that begins with their count (uint16), and the position after it."""
        if end - start < 2:
            raise self.error(start, "a list has no count")
        (count,) = struct.unpack_from("<H", self.data, start)
        size = count * width * np.dtype(kind).itemsize
        if start + 2 + size > end:
            raise self.error(start, f"a list of {count} needs {size} bytes; {end - start - 2} follow")
        return self.numbers(start + 2, kind, count * width).reshape(count, width), start + 2 + size

    def numbers(self, start: int, kind: str, count: int) -> NDArray[np.float64]:
        """Return (count,) numbers from a byte on; they may be NaN."""
        with np.errstate(invalid="ignore"):  # a signalling NaN raises a flag
            return np.frombuffer(self.data, kind, count, start).astype(np.float64)

    def floats(self, start: int, end: int, count: int) -> NDArray[np.float64]:
        """Return (count,) finite numbers.

        Raises:
            ShapeError: If they are truncated or not finite.
        """
        if end - start < 4 * count:
            raise self.error(start, f"{count} numbers are needed; {max(end - start, 0)} bytes follow")
        found = self.numbers(start, "<f4", count)
        if not np.isfinite(found).all():
            raise self.error(start, f"{found.tolist()} must be finite")
        return found

    def error(self, position: int, reason: str) -> ShapeError:
        """Return an error at a byte."""
        return ShapeError(self.path, reason, place=f"byte {position}")

    def warn(self, warning: str) -> None:
        """Record a warning once; at most a hundred, because a damaged file can cause any number."""
        if len(self.warnings) < 100 and warning not in self.warnings:
            self.warnings.append(warning)
