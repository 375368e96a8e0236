"""Assignments of the controller's values to words of %R.

A client reads positions, alarms and variables only from assigned words. This table has three blocks; one
question reads a block. The last two words of a block prove that the table is this one: they hold a version of
the controller's software, multiplied by a number of the table.

    10001   position   50: the current position       2: proof
    10053   state      18: the task, 40: the software's version, 2 each: speed override, number of the
                       frame, number of the tool, 26 for each tool, 2 for each register   2: proof
    then    alarms     100 for each of the newest alarms                                  2: proof
"""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import ClassVar, TypeAlias

FIRST_WORD = 10_001
"""The words before it are the numeric registers in a controller's delivered table."""
ALARMS = 4
"""Active alarms that are read, the newest first."""
MOST_TOOLS, MOST_REGISTERS, MOST_GROUPS = 10, 60, 8
MOST_REGISTER = 10_000
ALARM_WORDS, POSITION_WORDS, TASK_WORDS, TEXT_WORDS = 100, 50, 18, 40
TOOL_WORDS, NUMBER_WORDS = 26, 2
_VERSIONS = range(2, 100)


def _check(number: int, most: int, what: str) -> None:
    if not 1 <= number <= most:
        raise ValueError(f"{what} {number}: must be 1 to {most}")


@dataclass(frozen=True, slots=True)
class CurrentPosition:
    """Position of a motion group in the world frame: Cartesian and by joints."""

    group: int
    words: ClassVar[int] = POSITION_WORDS

    def __post_init__(self) -> None:
        _check(self.group, MOST_GROUPS, "group")

    def __str__(self) -> str:
        return f"POS[G{self.group}:0]"


@dataclass(frozen=True, slots=True)
class MasterTask:
    """Name, line and state of the first task's program."""

    words: ClassVar[int] = TASK_WORDS

    def __str__(self) -> str:
        return "PRG[1]"


@dataclass(frozen=True, slots=True)
class ActiveAlarms:
    """The newest active alarms."""

    words: ClassVar[int] = ALARM_WORDS * ALARMS

    def __str__(self) -> str:
        return "ALM[1]"


@dataclass(frozen=True, slots=True)
class ToolFrame:
    """A tool's frame in that of the flange."""

    group: int
    number: int
    words: ClassVar[int] = TOOL_WORDS

    def __post_init__(self) -> None:
        _check(self.group, MOST_GROUPS, "group")
        _check(self.number, MOST_TOOLS, "tool")

    def __str__(self) -> str:
        return f"$MNUTOOL[{self.group},{self.number}]@1.{TOOL_WORDS}"


@dataclass(frozen=True, slots=True)
class NumericRegister:
    """A numeric register R[]."""

    number: int
    words: ClassVar[int] = NUMBER_WORDS

    def __post_init__(self) -> None:
        _check(self.number, MOST_REGISTER, "register")

    def __str__(self) -> str:
        return f"R[{self.number}]"


class SystemVariable(Enum):
    """System variables of the whole controller."""

    SNPX_VERSION = "$SNPX_PARAM.$VERSION"
    SOFTWARE = "$VERSION"
    SPEED_OVERRIDE = "$MCR.$GENOVERRIDE"

    @property
    def words(self) -> int:
        """Number of its words."""
        return TEXT_WORDS if self is SystemVariable.SOFTWARE else NUMBER_WORDS

    def __str__(self) -> str:
        return self.value


class GroupVariable(Enum):
    """System variables that each motion group has."""

    FRAME = "$MNUFRAMENUM"
    TOOL = "$MNUTOOLNUM"


@dataclass(frozen=True, slots=True)
class OfGroup:
    """A system variable of a motion group."""

    variable: GroupVariable
    group: int
    words: ClassVar[int] = NUMBER_WORDS

    def __post_init__(self) -> None:
        _check(self.group, MOST_GROUPS, "group")

    def __str__(self) -> str:
        return f"{self.variable.value}[{self.group}]"


Variable: TypeAlias = (
    CurrentPosition | MasterTask | ActiveAlarms | ToolFrame | NumericRegister | SystemVariable | OfGroup
)


@dataclass(frozen=True, slots=True)
class Assignment:
    """Assignment of a value of the controller to words.

    Attributes:
        first_word: Number of its first word in %R, from 1.
        multiply: 0 for floating-point numbers, 1 for texts; otherwise the factor of integers.
    """

    first_word: int
    variable: Variable
    multiply: int

    @property
    def command(self) -> str:
        """Text that asks the controller for it."""
        return f"SETASG {self.first_word} {self.variable.words} {self.variable} {self.multiply}"


@dataclass(frozen=True, slots=True)
class Block:
    """Words that one question reads; the last two prove that the table is the gateway's."""

    assignments: Sequence[Assignment]

    @property
    def first_word(self) -> int:
        """Number of its first word in %R, from 1."""
        return self.assignments[0].first_word

    @property
    def words(self) -> int:
        """Number of its words."""
        last = self.assignments[-1]
        return last.first_word + last.variable.words - self.first_word

    def values(self, data: bytes) -> dict[Variable, bytes] | None:
        """Return the bytes of each value; None: the words are not those of this table.

        Args:
            data: All bytes of the block.
        """
        proof = self.assignments[-1]
        version, rest = divmod(int.from_bytes(data[-4:], "little", signed=True), proof.multiply)
        if rest or version not in _VERSIONS:
            return None
        found: dict[Variable, bytes] = {}
        for each in self.assignments:
            begin = 2 * (each.first_word - self.first_word)
            found[each.variable] = data[begin : begin + 2 * each.variable.words]
        return found


PENDANT_MULTIPLY = 1000
"""The proof's, in a table that an operator enters."""


class Table:
    """All assignments of one robot.

    Args:
        own: The gateway makes the table, and its proof differs from that of other tables.
        tools: Numbers of the tools with a frame to read.
        registers: Numbers of the registers to read.

    Raises:
        ValueError: If there is no such group, tool or register, or there are too many.
    """

    def __init__(
        self, group: int, tools: Sequence[int], registers: Sequence[int], *, own: bool = True
    ) -> None:
        for given, most, what in ((tools, MOST_TOOLS, "tools"), (registers, MOST_REGISTERS, "registers")):
            if len(given) > most or len({*given}) < len(given):
                raise ValueError(f"{what}: at most {most}, each once; {len(given)} were given")
        self.position_of = CurrentPosition(group)
        self.tools = tuple(ToolFrame(group, each) for each in tools)
        self.registers = tuple(NumericRegister(each) for each in registers)
        self.frame_number, self.tool_number = (OfGroup(each, group) for each in GroupVariable)
        state: list[tuple[Variable, int]] = [(MasterTask(), 1), (SystemVariable.SOFTWARE, 1)]
        state += [(each, 1) for each in (SystemVariable.SPEED_OVERRIDE, self.frame_number, self.tool_number)]
        state += [(each, 0) for each in self.tools]
        state += [(each, 0) for each in self.registers]
        position: list[tuple[Variable, int]] = [(self.position_of, 0)]
        alarms: list[tuple[Variable, int]] = [(ActiveAlarms(), 1)]
        contents = (position, state, alarms)
        names = " ".join(str(variable) for content in contents for variable, _ in content)
        # Every other table has most probably another number; 10000 is the greatest.
        self._multiply = 1001 + zlib.crc32(names.encode()) % 9000 if own else PENDANT_MULTIPLY
        self._next_word = FIRST_WORD
        self.position, self.state, self.alarms = (self._block(each) for each in contents)

    def _block(self, content: Sequence[tuple[Variable, int]]) -> Block:
        found = []
        for variable, multiply in (*content, (SystemVariable.SNPX_VERSION, self._multiply)):
            found.append(Assignment(self._next_word, variable, multiply))
            self._next_word += variable.words
        return Block(found)

    @property
    def blocks(self) -> Sequence[Block]:
        """All blocks."""
        return self.position, self.state, self.alarms

    @property
    def assignments(self) -> Sequence[Assignment]:
        """All assignments, in the order of their words."""
        return [each for block in self.blocks for each in block.assignments]
