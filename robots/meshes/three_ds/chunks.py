"""The chunks that a 3DS file is made of.

chunk = id:uint16 length:uint32 data        length counts these 6 bytes too; little-endian
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robots.errors import MeshError

_HEADER = struct.Struct("<HI")


@dataclass(frozen=True)
class Chunk:
    """One chunk's id and the bytes of its data, from `start` to before `end`."""

    id: int
    start: int
    end: int


@dataclass(frozen=True)
class Source:
    """A file's bytes, and what was odd in them."""

    path: Path
    data: bytes
    warnings: list[str] = field(default_factory=list)

    def chunks(self, start: int, end: int, *, lenient: bool = False) -> Iterator[Chunk]:
        """The chunks side by side between two bytes.

        Args:
            lenient: A length that overruns ends with what is there, and is warned of: some programs
                write the outermost ones wrong, and what lies inside is whole all the same.

        Raises:
            MeshError: If a chunk is longer than what holds it, with its byte.
        """
        while end - start >= _HEADER.size:
            identity, length = _HEADER.unpack_from(self.data, start)
            problem = f"chunk {identity:04X} of {length} bytes; {end - start} are left there"
            if length < _HEADER.size:
                if not lenient:
                    raise self.error(start, problem)
                self.warn(f"byte {start}: {problem}; what follows is left out")
                return
            stop = start + length
            if stop > end:
                if not lenient:
                    raise self.error(start, problem)
                self.warn(f"byte {start}: {problem}; read as far as it goes")
                stop = end
            yield Chunk(identity, start + _HEADER.size, stop)
            start = stop

    def text(self, start: int, end: int) -> tuple[str, int]:
        """A string that ends with a zero byte, and the byte after it."""
        zero = self.data.find(b"\0", start, end)
        if zero < 0:
            raise self.error(start, "a name that does not end")
        return self.data[start:zero].decode("latin-1"), zero + 1

    def array(self, start: int, end: int, kind: str, width: int) -> tuple[NDArray[np.float64], int]:
        """A count (uint16) and as many rows; and the byte after them."""
        if end - start < 2:
            raise self.error(start, "a list without its count")
        (count,) = struct.unpack_from("<H", self.data, start)
        size = count * width * np.dtype(kind).itemsize
        if start + 2 + size > end:
            raise self.error(start, f"a list of {count} that needs {size} bytes; {end - start - 2} are there")
        return self.numbers(start + 2, kind, count * width).reshape(count, width), start + 2 + size

    def numbers(self, start: int, kind: str, count: int) -> NDArray[np.float64]:
        """(count,) numbers from a byte on; they may be anything, NaN too."""
        with np.errstate(invalid="ignore"):  # signalling NaN
            return np.frombuffer(self.data, kind, count, start).astype(np.float64)

    def floats(self, start: int, end: int, count: int) -> NDArray[np.float64]:
        """(count,) numbers; refused where they are cut short or not finite."""
        if end - start < 4 * count:
            raise self.error(start, f"{count} numbers are due; {max(end - start, 0)} bytes are there")
        found = self.numbers(start, "<f4", count)
        if not np.isfinite(found).all():
            raise self.error(start, f"{found.tolist()}; finite numbers are right")
        return found

    def error(self, position: int, reason: str) -> MeshError:
        """What is wrong, with its byte."""
        return MeshError(self.path, reason, place=f"byte {position}")

    def warn(self, warning: str) -> None:
        """Keep a warning; a broken file has no end of them."""
        if len(self.warnings) < 100 and warning not in self.warnings:
            self.warnings.append(warning)
