"""A VRML file's text, with line numbers, errors and warnings."""

import codecs
import re
import zlib
from dataclasses import dataclass, field
from pathlib import Path

from robots.schema.errors import ShapeError

# gzip shrinks text by a factor of 5 to 20. A file that unpacks to 100 times its size is an attack.
_MOST_UNPACKED = 100
_ALWAYS_UNPACKED = 16 << 20
_MOST_WARNINGS = 100
# Longest message [characters].
_LONGEST = 250
_LINE_END = re.compile(r"\r\n?|\n")


@dataclass
class Count:
    """The number of nodes and fields that PROTOs have made, over all files of a scene."""

    made: int = 0


@dataclass(eq=False)
class Source:
    """A file's text.

    Attributes:
        warnings: A sentence each, at most a hundred.
        count: The counter of the scene that the file belongs to.
    """

    path: Path
    text: str
    warnings: list[str] = field(default_factory=list)
    count: Count = field(default_factory=Count)
    _warned_once: set[str] = field(default_factory=set)

    def place(self, position: int) -> str:
        """Return a position in the text as "line 3, column 5", both counted from 1."""
        text = self.text
        # Lines end with \n, \r or both.
        ends = [text.count(end, 0, position) for end in ("\n", "\r", "\r\n")]
        last = max(text.rfind("\n", 0, position), text.rfind("\r", 0, position))
        return f"line {ends[0] + ends[1] - ends[2] + 1}, column {position - last}"

    def error(self, position: int, reason: str) -> ShapeError:
        """Return an error at a position."""
        return ShapeError(self.path, _short(reason), place=self.place(position))

    def warn(self, position: int, warning: str, *, once: str = "") -> None:
        """Record a warning at a position; of warnings with the same `once`, only the first."""
        if once in self._warned_once or len(self.warnings) >= _MOST_WARNINGS:
            return
        if once:
            self._warned_once.add(once)
        self.warnings.append(f"{self.place(position)}: {_short(warning)}")


def _short(text: str) -> str:
    """Return a text as one short printable line: it may quote the file."""
    text = " ".join(text.split())
    text = "".join(letter if letter.isprintable() else "?" for letter in text[: _LONGEST + 1])
    return text if len(text) <= _LONGEST else text[:_LONGEST] + "…"


def load(path: Path) -> Source:
    """Read a .wrl file, or a .wrz file, which is compressed with gzip.

    Raises:
        ShapeError: If it cannot be read, or is not VRML 2.0.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ShapeError(path, f"cannot be read: {error.strerror}") from error
    if data[:2] == b"\x1f\x8b":
        data = _unpacked(data, path)
    data = data.removeprefix(codecs.BOM_UTF8).rstrip(b"\0")
    if not data.strip():
        raise ShapeError(path, "is empty; a VRML 2.0 file begins with '#VRML V2.0 utf8'")
    if b"\0" in data[:1024]:
        raise ShapeError(path, "is not VRML 2.0: it contains binary data")
    try:
        source = Source(path, data.decode("utf-8"))
    except UnicodeDecodeError as error:
        source = Source(path, data.decode("latin-1"))
        source.warn(error.start, "is not UTF-8; the file is read as Latin-1")
    _check_header(source)
    return source


def _unpacked(data: bytes, path: Path) -> bytes:
    most = max(_ALWAYS_UNPACKED, _MOST_UNPACKED * len(data))
    unpacker = zlib.decompressobj(wbits=31)
    try:
        unpacked = unpacker.decompress(data, most)
    except zlib.error as error:
        raise ShapeError(path, f"is gzip data, but damaged: {error}") from error
    if unpacker.unconsumed_tail:
        raise ShapeError(path, f"unpacks to more than {most >> 20} MiB, too much for a mesh of its size")
    if not unpacker.eof:
        raise ShapeError(path, "is gzip data, but truncated")
    return unpacked


def _check_header(source: Source) -> None:
    first = _LINE_END.split(source.text[:200].lstrip(), maxsplit=1)[0].strip()
    words = first.replace("#", "# ", 1).split()
    if words[:3] == ["#", "VRML", "V1.0"]:
        raise source.error(0, "is VRML 1.0; only VRML 2.0 is read: convert it first")
    if words[:2] in (["#", "X3D"], ["#", "Inventor"]):
        raise source.error(0, f"is {words[1]}; only VRML 2.0 is read: convert it first")
    if words[:3] != ["#", "VRML", "V2.0"]:
        if "{" not in source.text:
            raise ShapeError(
                source.path, f"is not VRML 2.0: it begins with {first[:40]!r}, not '#VRML V2.0 utf8'"
            )
        source.warn(0, "the header '#VRML V2.0 utf8' is missing; read as VRML 2.0")
    elif not first.startswith("#VRML"):
        source.warn(0, "the header has a blank, '# VRML'; it should be '#VRML V2.0 utf8'")
