"""A VRML file's text, and what is said of it: places, errors, warnings."""

import codecs
import re
import zlib
from dataclasses import dataclass, field
from pathlib import Path

from robots.errors import MeshError

# Text shrinks 5 to 20 times by gzip; what unpacks to more than this is made to fill the memory.
_MOST_UNPACKED = 100
_ALWAYS_UNPACKED = 16 << 20
_MOST_WARNINGS = 100
# Of what is said of one place.
_LONGEST = 250
_LINE_END = re.compile(r"\r\n?|\n")


@dataclass
class Count:
    """How much has been made of PROTOs, over all files of a scene: nodes and their fields."""

    made: int = 0


@dataclass(eq=False)
class Source:
    """A file's text.

    Attributes:
        warnings: What was odd in it, a sentence each, at most a hundred.
        count: Of the scene that it belongs to.
    """

    path: Path
    text: str
    warnings: list[str] = field(default_factory=list)
    count: Count = field(default_factory=Count)
    _said: set[str] = field(default_factory=set)

    def place(self, position: int) -> str:
        """ "line 3, column 5" of a position in the text, both counted from 1."""
        text = self.text
        # Lines end by \n, \r or both.
        ends = [text.count(end, 0, position) for end in ("\n", "\r", "\r\n")]
        last = max(text.rfind("\n", 0, position), text.rfind("\r", 0, position))
        return f"line {ends[0] + ends[1] - ends[2] + 1}, column {position - last}"

    def error(self, position: int, reason: str) -> MeshError:
        """An error at a position."""
        return MeshError(self.path, _short(reason), place=self.place(position))

    def warn(self, position: int, warning: str, *, once: str = "") -> None:
        """Note what is odd at a position; what has the same `once` is noted where it comes first."""
        if once in self._said or len(self.warnings) >= _MOST_WARNINGS:
            return
        if once:
            self._said.add(once)
        self.warnings.append(f"{self.place(position)}: {_short(warning)}")


def _short(text: str) -> str:
    """On one line that a person, or a terminal, can read: it may quote the file."""
    text = " ".join(text.split())
    text = "".join(letter if letter.isprintable() else "?" for letter in text[: _LONGEST + 1])
    return text if len(text) <= _LONGEST else text[:_LONGEST] + "…"


def load(path: Path) -> Source:
    """The text of a .wrl file, or of a .wrz one, which gzip has compressed.

    Raises:
        MeshError: If it cannot be read, or is not VRML 2.0.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MeshError(path, f"cannot be read: {error.strerror}") from error
    if data[:2] == b"\x1f\x8b":
        data = _unpacked(data, path)
    data = data.removeprefix(codecs.BOM_UTF8).rstrip(b"\0")
    if not data.strip():
        raise MeshError(path, "is empty; a VRML 2.0 file begins '#VRML V2.0 utf8'")
    if b"\0" in data[:1024]:
        raise MeshError(path, "is not VRML 2.0: it holds binary data")
    try:
        source = Source(path, data.decode("utf-8"))
    except UnicodeDecodeError as error:
        source = Source(path, data.decode("latin-1"))
        source.warn(error.start, "no UTF-8; the file is read as Latin-1")
    _check_header(source)
    return source


def _unpacked(data: bytes, path: Path) -> bytes:
    most = max(_ALWAYS_UNPACKED, _MOST_UNPACKED * len(data))
    unpacker = zlib.decompressobj(wbits=31)
    try:
        unpacked = unpacker.decompress(data, most)
    except zlib.error as error:
        raise MeshError(path, f"is compressed by gzip, and broken: {error}") from error
    if unpacker.unconsumed_tail:
        raise MeshError(path, f"unpacks to more than {most >> 20} MiB; a mesh does not shrink like that")
    if not unpacker.eof:
        raise MeshError(path, "is compressed by gzip, and cut short")
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
            raise MeshError(source.path, f"is not VRML 2.0: it begins {first[:40]!r}, not '#VRML V2.0 utf8'")
        source.warn(0, "no header '#VRML V2.0 utf8'; read as VRML 2.0 all the same")
    elif not first.startswith("#VRML"):
        source.warn(0, "a blank in the header, '# VRML'; it should be '#VRML V2.0 utf8'")
