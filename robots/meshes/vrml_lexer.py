"""VRML97 text to tokens.

    number      [+-]? ( digits [. digits] | . digits ) [e [+-] digits] | 0x hex
    string      " ... "   with \\" and \\\\ inside
    word        anything else without blanks and { } [ ] " # , . (an IS or a field's name)
    mark        { } [ ]
    blank       space, tab, newline, comma; # to the end of the line

Number lists are most of a file: they are taken whole, by NumPy, not token by token.

Source: ISO/IEC 14772-1:1997, annex A.
"""

import bisect
import re
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

import numpy as np

from robots.errors import MeshError
from robots.meshes.mesh import FloatArray


class Kind(Enum):
    """What a token is."""

    NUMBER = "number"
    STRING = "string"
    WORD = "word"
    MARK = "mark"
    END = "end of file"


@dataclass(frozen=True, slots=True)
class Token:
    """A token: its text (a string's without quotes and escapes) and where it begins."""

    kind: Kind
    text: str
    position: int


_NUMBER = r"(?:[+-]?(?:0[xX][0-9a-fA-F]+|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?))"
_TOKEN = re.compile(
    rf"""(?:[\s,]+|\#[^\n\r]*)*
    (?: (?P<number>{_NUMBER})(?=[\s,\[\]{{}}"\#]|$)
      | (?P<split>[+-])[ \t]+(?P<digits>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?=[\s,\[\]{{}}"\#]|$)
      | "(?P<string>(?:[^"\\]|\\.)*)"
      | (?P<mark>[\[\]{{}}])
      | (?P<word>[^\s,\[\]{{}}"\#]+)
      | (?P<end>$) )""",
    re.VERBOSE | re.DOTALL,
)
_COMMENT = re.compile(r"#[^\n\r]*")
_SPLIT_SIGN = re.compile(r"([+-])[ \t]+(?=[\d.])")


@dataclass
class Lexer:
    """Reads tokens one after the other, one ahead."""

    text: str
    source: Path
    warnings: list[str] = field(default_factory=list)
    _position: int = 0
    _peeked: Token | None = None
    _newlines: list[int] | None = None

    def peek(self) -> Token:
        """The next token, which stays."""
        if self._peeked is None:
            self._peeked = self._read()
        return self._peeked

    def next(self) -> Token:
        """The next token.

        Raises:
            MeshError: At text that is no token (a string that does not end).
        """
        token = self.peek()
        self._peeked = None
        return token

    def number_list(self) -> FloatArray | None:
        """The numbers up to the `]` when only numbers stand before it; None, and nothing read, otherwise."""
        first = self.peek()
        if first.kind is not Kind.NUMBER and first.text != "]":
            return None
        start = first.position
        end = self.text.find("]", start)
        if end < 0:
            return None
        body = self.text[start:end]
        if "#" in body:
            # A comment may hold a bracket: find the end again, without the comments.
            end, body = self._without_comments(start)
        try:
            numbers = np.array(body.replace(",", " ").split(), dtype=np.float64)
        except ValueError:
            joined = _SPLIT_SIGN.sub(r"\1", body)
            try:
                numbers = np.array(joined.replace(",", " ").split(), dtype=np.float64)
            except ValueError:
                return None
            sign = _SPLIT_SIGN.search(self.text, start)
            self._warn_of_split_sign(sign.start() if sign else start)
        # NumPy would take "nan" and "inf"; VRML has no such numbers.
        if not np.isfinite(numbers).all():
            return None
        self._position, self._peeked = end + 1, None
        return numbers

    def _without_comments(self, start: int) -> tuple[int, str]:
        pieces: list[str] = []
        position = start
        while True:
            bracket = self.text.find("]", position)
            comment = self.text.find("#", position)
            if bracket < 0 or comment < 0 or bracket < comment:
                end = bracket if bracket >= 0 else len(self.text)
                pieces.append(self.text[position:end])
                return end, " ".join(pieces)
            pieces.append(self.text[position:comment])
            match = _COMMENT.match(self.text, comment)
            position = match.end() if match else comment + 1

    def error(self, reason: str, token: Token | None = None) -> MeshError:
        """An error at a token, or here."""
        position = self._position if token is None else token.position
        return MeshError(self.source, reason, place=f"line {self.line(position)}")

    def line(self, position: int) -> int:
        """The number of the line that a position is on."""
        if self._newlines is None:
            self._newlines = [match.start() for match in re.finditer("\n", self.text)]
        return bisect.bisect_left(self._newlines, position) + 1

    def _read(self) -> Token:
        match = _TOKEN.match(self.text, self._position)
        if match is None:
            raise self.error("a string that does not end")
        kind = match.lastgroup
        self._position = match.end()
        if kind == "digits":
            self._warn_of_split_sign(match.start("split"))
            return Token(Kind.NUMBER, match["split"] + match["digits"], match.start("split"))
        assert kind is not None
        if kind == "string":
            text = re.sub(r"\\(.)", r"\1", match["string"], flags=re.DOTALL)
            return Token(Kind.STRING, text, match.start("string") - 1)
        return Token(Kind[kind.upper()], match[kind], match.start(kind))

    def _warn_of_split_sign(self, position: int) -> None:
        # Chen, Zhang, Xue 2001 prints "- 25.08"; files like that exist.
        warning = "a sign stands apart from its digits; read as one number"
        if not any(warning in known for known in self.warnings):
            self.warnings.append(f"line {self.line(position)}: {warning}")
