"""Table of numeric record types.

The paper carries the type "for simplicity, directly as a 32-bit integer", for "data or command, and which
command". So a code means a type, or one command. A site file gives a controller's own table,
`codes = { 2 = "ABSOLUTE.DEG", 101 = "COMMAND:home" }`. It replaces the default table, because a number
must not have a meaning that the site file does not give.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

from protocol_gateway.seam.errors import CodeTableError
from protocol_gateway.unit_protocol.grammar import plain_text

COMMAND = "COMMAND"
ABSOLUTE = "ABSOLUTE.DEG"
RELATIVE = "RELATIVE.DEG"
VELOCITY = "VELOCITY.DEG"
STATUS = "STATUS"
ERROR = "ERROR"
TIME = "TIME"

TYPES = (COMMAND, ABSOLUTE, RELATIVE, VELOCITY, STATUS, ERROR, TIME)

# "speed" without its number, which is the record's datum.
COMMAND_WORDS = ("trace", "untrace", "home", "stop", "hold", "resume", "reset", "speed")


class Meaning(NamedTuple):
    """Meaning of a code: a type, or, with a word, one command."""

    type: str
    word: str | None = None


@dataclass(frozen=True)
class CodeTable:
    """Type codes of one controller.

    Attributes:
        meanings: Meaning of each code.
        codes: Code of each meaning; empty where types are written as names.
    """

    meanings: Mapping[int, Meaning]
    codes: Mapping[Meaning, int]

    def supports(self, word: str) -> bool:
        """Return whether the controller knows a command: by name, or by a code if it only knows codes."""
        return not self.codes or Meaning(COMMAND) in self.codes or Meaning(COMMAND, word) in self.codes

    def command_markers(self, word: str) -> tuple[bytes, ...]:
        """Return byte strings of which every unit with this command contains one: word or code's digits."""
        code = self.codes.get(Meaning(COMMAND, word))
        return (word.encode(),) if code is None else (word.encode(), b"%d" % abs(code))


def code_table(codes: Mapping[int, str]) -> CodeTable:
    """Build the table from a site file's `codes`; without codes return the default, which writes names.

    Raises:
        CodeTableError: If an entry is not `TYPE` or `COMMAND:word`, or two codes have one meaning.
    """
    if not codes:
        return NAMES
    meanings: dict[int, Meaning] = {}
    written: dict[Meaning, int] = {}
    for code, text in codes.items():
        meaning = _meaning(code, text)
        if meaning in written:
            raise CodeTableError(f"codes: {text} has two codes, {written[meaning]} and {code}; give one")
        meanings[code] = meaning
        written[meaning] = code
    return CodeTable(MappingProxyType(meanings), MappingProxyType(written))


def _meaning(code: int, text: str) -> Meaning:
    if not -(2**31) <= code < 2**31:
        raise CodeTableError(f"codes: {code} is outside int32")
    type_name, colon, word = text.partition(":")
    if colon and type_name == COMMAND and word in COMMAND_WORDS:
        return Meaning(COMMAND, word)
    # The site file may name a controller's own type, which is then published raw under that name.
    if not colon and text and plain_text(text) == text:
        return Meaning(text)
    raise CodeTableError(
        f"codes: {code} = {text!r} is neither a type ({', '.join(TYPES)}) "
        f"nor a command (COMMAND: and one of {', '.join(COMMAND_WORDS)})"
    )


NAMES = CodeTable(
    meanings=MappingProxyType({code: Meaning(name) for code, name in enumerate(TYPES, start=1)}),
    codes=MappingProxyType({}),
)
"""Default table: reads codes 1 to 7, writes names."""
