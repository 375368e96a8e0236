"""Lexer of VRML97 text.

    numbers     number *( blank number )
    number      [+-] [blanks] ( digits [. digits] | . digits ) [e [+-] digits] | 0x hex
    string      " ... "   with \\" and \\\\ inside
    word        any other text without blanks and { } [ ] " # (an IS or a field's name)
    mark        { } [ ]
    blank       space, tab, line end, comma; # to the end of the line

Most of a file is number lists, so NumPy parses each list as a whole instead of token by token.

Source: ISO/IEC 14772-1:1997, annex A.
"""

import re
import warnings
from collections.abc import Callable
from enum import Enum

import numpy as np

from robots.schema.errors import ShapeError
from robots.shapes.files.vrml.source import Source
from robots.shapes.geometry import FloatArray


class Kind(Enum):
    """The kind of a token."""

    NUMBERS = "numbers"
    STRING = "string"
    WORD = "word"
    MARK = "mark"
    END = "end of the file"


# Each character has one place in an expression, so matching takes linear time without possessive quantifiers,
# which Python 3.11.2 matches wrongly. Comments and the parts of a string are matched one by one.
_DIGITS = r"(?:0[xX][0-9a-fA-F]+|(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
_NUMBER = rf"""(?:[+-][ \t]*)?{_DIGITS}(?=[\s,\[\]{{}}"\#]|$)"""
_TOKEN = re.compile(
    rf"""(?P<MARK>[\[\]{{}}])
      | (?P<NUMBERS>{_NUMBER}(?:[\s,]+{_NUMBER}){{0,15}})
      | (?P<WORD>[^\s,\[\]{{}}"\#]+)
      | (?P<STRING>")
      | (?P<END>$)""",
    re.VERBOSE,
)
_KINDS = {kind.name: kind for kind in Kind}
_BLANKS = re.compile(r"[\s,]*(?:#[^\n\r]*)?")
_STRING_PART = re.compile(r'\\.|"', re.DOTALL)
_FIRST_OF_NUMBERS = frozenset("-+.0123456789]")
_BLANK = re.compile(r"[\s,]")
_SPLIT_SIGN = re.compile(r"([+-])[ \t]+(?=[0-9.])")
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)
# Programs built with a Microsoft compiler print NaN as "1.#QNAN"; the # does not begin a comment there.
_NO_NUMBER = re.compile(r"[0-9]\.#(?:IND|QNAN|SNAN|INF)")
# VRML's floats have single precision; larger numbers would overflow in products.
_LARGEST = float(np.finfo(np.float32).max)
_PIECE = 1 << 20
# Shorter lists [characters] parse faster without NumPy.
_SHORT = 500


class Lexer:
    """A cursor at the current token; `advance` moves it to the next.

    Attributes:
        kind, text, start: The current token; a string's text is without quotes and escapes.
    """

    def __init__(self, source: Source, progress: Callable[[float], None] | None = None) -> None:
        self.source = source
        self.kind = Kind.END
        self.text = ""
        self.start = 0
        self._all = source.text
        self._end = 0
        self._progress = progress
        self.advance()

    def advance(self) -> None:
        """Move to the next token; after the last, stay at the end.

        Raises:
            ShapeError: If a string does not end.
        """
        match = _TOKEN.match(self._all, self._after_blanks(self._end))
        name = match.lastgroup if match is not None else None
        if match is None or name is None:  # unreachable: any character begins a token
            raise self.source.error(self._end, "this text is not VRML")
        self.start, self._end = match.span()
        self.kind, self.text = _KINDS[name], match[0]
        if self.kind is Kind.STRING:
            parts = _STRING_PART.finditer(self._all, self._end)
            end = next((part for part in parts if part[0] == '"'), None)
            if end is None:
                raise self.source.error(self.start, "this string does not end: a '\"' is missing")
            self.text, self._end = self._all[self._end : end.start()], end.end()
            if "\\" in self.text:
                self.text = _ESCAPE.sub(r"\1", self.text)

    def _after_blanks(self, position: int) -> int:
        """Return the position after blanks and comments."""
        while (found := _BLANKS.match(self._all, position)) is not None and found.end() > position:
            position = found.end()
        return position

    def is_mark(self, mark: str) -> bool:
        """Return whether the current token is this one of { } [ ]."""
        return self.text == mark and self.kind is Kind.MARK

    def is_word(self, *words: str) -> bool:
        """Return whether the current token is one of these words."""
        return self.kind is Kind.WORD and self.text in words

    def found(self) -> str:
        """Return the current token in words, for an error."""
        if self.kind is Kind.END:
            return "the end of the file"
        text = self.text.split()[0] if self.kind is Kind.NUMBERS else self.text
        return repr(text if len(text) <= 40 else text[:40] + "…")

    def expected(self, what: str) -> ShapeError:
        """Return an error that says what was expected instead of the current token."""
        return self.source.error(self.start, f"{what} was expected, not {self.found()}")

    def numbers(self) -> list[float]:
        """Return the numbers of consecutive NUMBERS tokens, which comments separate, and move past them.

        Raises:
            ShapeError: If a number is too large.
        """
        values: list[float] = []
        while self.kind is Kind.NUMBERS:
            values += self._run()
            self.advance()
        return values

    def _run(self) -> list[float]:
        text = self.text
        if "+" in text or "-" in text:
            text = self._joined_signs(text, self.start)
        words = text.replace(",", " ").split()
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = [float(_whole(word)) if "x" in word.lower() else float(word) for word in words]
        for word, value in zip(words, values, strict=True):
            if abs(value) > _LARGEST:
                position = self.source.text.find(word, self.start)
                raise self.source.error(position, f"{word[:40]} is too large for a number")
        return values

    def number_list(self) -> FloatArray | None:
        """Return the numbers between "[", the current token, and "]", and move past it.

        Return None and stay if the list does not begin with a number.
        """
        start = self._after_blanks(self._end)
        if self._all[start : start + 1] not in _FIRST_OF_NUMBERS:
            return None
        end = self._all.find("]", start)
        pieces = self._fast_pieces(start, end) if end >= 0 else None
        if pieces is None:
            return self._slow_list()
        self._end = end + 1
        self.advance()
        return np.concatenate(pieces) if pieces else np.zeros(0)

    def _fast_pieces(self, start: int, end: int) -> list[FloatArray] | None:
        """Return the numbers in a span; None if it contains anything but numbers and blanks."""
        pieces = []
        while start < end:
            blank = _BLANK.search(self._all, min(start + _PIECE, end), end)
            stop = blank.start() if blank is not None else end
            piece = self._all[start:stop]
            if "#" in piece:
                return None
            if "," in piece:
                piece = piece.replace(",", " ")
            piece = piece.strip()
            if piece:
                values = _parsed(piece)
                if values is None:
                    return None
                pieces.append(values)
            start = stop
            if self._progress is not None:
                self._progress(stop / len(self._all))
        return pieces

    def _slow_list(self) -> FloatArray:
        """Return the numbers of a list with comments, detached signs or errors, and move past it."""
        opening = self.start
        self.advance()
        values: list[float] = []
        while self.kind is Kind.NUMBERS:
            bad = _NO_NUMBER.match(self._all, self._end - 2)
            if bad is not None:
                raise self.source.error(self._end - 2, f"a number was expected, not {bad[0]!r}")
            values += self._run()
            self.advance()
        if self.kind is Kind.END:
            raise self.source.error(opening, "this '[' is never closed")
        if not self.is_mark("]"):
            raise self.expected("a number or ']'")
        self.advance()
        return np.array(values)

    def _joined_signs(self, text: str, start: int) -> str:
        split = _SPLIT_SIGN.search(text)
        if split is None:
            return text
        # Chen, Zhang, Xue 2001 prints "- 25.08", and some files do too.
        self.source.warn(
            start + split.start(),
            "a sign is separated from its digits by a blank; read as one number",
            once="sign",
        )
        return _SPLIT_SIGN.sub(r"\1", text)


def _parsed(text: str) -> FloatArray | None:
    """Return the numbers of a text without commas; None if a word is not a number."""
    try:
        if len(text) < _SHORT:
            values = np.array([float(word) for word in text.split()])
        else:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                # Vertex numbers, half of most files, parse three times as fast as integers.
                whole = not any(mark in text for mark in ".eE")
                values = np.fromstring(text, dtype=np.int64 if whole else np.float64, sep=" ").astype(
                    np.float64, copy=False
                )
    except (ValueError, DeprecationWarning):
        return None
    # NumPy takes "nan", "inf" and 1e999; VRML has no such numbers.
    return values if (np.abs(values) <= _LARGEST).all() else None


def _whole(word: str) -> int:
    sign = -1 if word[0] == "-" else 1
    return sign * int(word.lstrip("+-"), 16)
