"""What a record's type means, when it is a number.

The paper carries the type "for simplicity, directly as a 32-bit integer", which tells "data or command,
and which command": so a code stands for a type, or for one command. A site file gives a
controller's own table, `codes = { 2 = "ABSOLUTE.DEG", 101 = "COMMAND:home" }`; it then replaces
the default one, because a number must mean nothing that the site file does not say.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

from protocol_gateway.core.grammar import plain_text
from protocol_gateway.errors import CodeTableError

COMMAND = "COMMAND"
ABSOLUTE = "ABSOLUTE.DEG"
RELATIVE = "RELATIVE.DEG"
VELOCITY = "VELOCITY.DEG"
STATUS = "STATUS"
ERROR = "ERROR"
TIME = "TIME"

TYPES = (COMMAND, ABSOLUTE, RELATIVE, VELOCITY, STATUS, ERROR, TIME)

# "speed" alone: its number is the record's datum.
COMMAND_WORDS = ("trace", "untrace", "home", "stop", "hold", "resume", "reset", "speed")


class Meaning(NamedTuple):
    """What a code stands for: a type, or, with a word, one command."""

    type: str
    word: str | None = None


@dataclass(frozen=True)
class CodeTable:
    """Type codes of one controller.

    Attributes:
        meanings: What each code stands for.
        codes: The other way; empty where types are written as names.
    """

    meanings: Mapping[int, Meaning]
    codes: Mapping[Meaning, int]

    def supports(self, word: str) -> bool:
        """Whether its controller knows a command: by name, or, where it knows codes only, by a code."""
        return not self.codes or Meaning(COMMAND) in self.codes or Meaning(COMMAND, word) in self.codes

    def command_markers(self, word: str) -> tuple[bytes, ...]:
        """What a unit that says a command holds, one at least: the word, or its code's digits."""
        code = self.codes.get(Meaning(COMMAND, word))
        return (word.encode(),) if code is None else (word.encode(), b"%d" % abs(code))


def code_table(codes: Mapping[int, str]) -> CodeTable:
    """The table of a site file's `codes`; the default one, written as names, when there are none.

    Raises:
        CodeTableError: If an entry is not `TYPE` or `COMMAND:word`, or a meaning stands twice.
    """
    if not codes:
        return NAMES
    meanings: dict[int, Meaning] = {}
    written: dict[Meaning, int] = {}
    for code, text in codes.items():
        meaning = _meaning(code, text)
        if meaning in written:
            raise CodeTableError(f"codes: {text} has two codes, {written[meaning]} and {code}; one is right")
        meanings[code] = meaning
        written[meaning] = code
    return CodeTable(MappingProxyType(meanings), MappingProxyType(written))


def _meaning(code: int, text: str) -> Meaning:
    if not -(2**31) <= code < 2**31:
        raise CodeTableError(f"codes: {code} is beyond int32")
    type_name, colon, word = text.partition(":")
    if colon and type_name == COMMAND and word in COMMAND_WORDS:
        return Meaning(COMMAND, word)
    # A controller's own type gets a name in the site file, so it is published raw under that name.
    if not colon and text and plain_text(text) == text:
        return Meaning(text)
    raise CodeTableError(
        f"codes: {code} = {text!r} stands for nothing: a type ({', '.join(TYPES)}) "
        f"or a command (COMMAND: and one of {', '.join(COMMAND_WORDS)})"
    )


NAMES = CodeTable(
    meanings=MappingProxyType({code: Meaning(name) for code, name in enumerate(TYPES, start=1)}),
    codes=MappingProxyType({}),
)
"""The default: codes 1 to 7 are read, names are written."""
