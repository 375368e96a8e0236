"""Memory of the simulated controller as clients read it: assignments, and bits of inputs and outputs."""

import re
from collections.abc import Collection
from dataclasses import dataclass
from struct import Struct

from controllers.fanuc.data import POSITION
from controllers.fanuc.simulated.controller import SOFTWARE, SnpxController

MOST_ASSIGNMENTS = 80
LAST_WORD = 16_384
_SETASG = re.compile(r"SETASG (\d{1,5}) (\d{1,5}) (\S{1,37})(?: (-?\d{1,5}(?:\.\d{1,6})?))?(?: .*)?")
_NAME = re.compile(r"([^@]+)(?:@(\d+)\.(\d+))?")
_POSITION = re.compile(r"POS\[(?:G(\d):)?(\d{1,2})\]")
_TOOL = re.compile(r"\$MNUTOOL\[(\d),(\d{1,2})\]")
# A letter before the number: another list, such as the history of alarms, which is empty here.
_INDEXED = re.compile(r"(R|SR|PRG|ALM)\[([A-Z]*)(\d{1,5})\]")
_FLOAT, _INTEGER = Struct("<f"), Struct("<i")
_WORD = 2
_TEXT_BYTES = 80
_TOOLS = 10
_NONE = 1_000_000


@dataclass(frozen=True, slots=True)
class Entry:
    """An assignment.

    Attributes:
        first: Its first word, from 1.
        words: Number of its words.
        name: What it assigns, such as POS[G1:0] or R[1]@1.1.
        multiply: 0: floating-point numbers.
    """

    first: int
    words: int
    name: str
    multiply: float


DELIVERED = (Entry(1, 10_000, "R[1]@1.1", 1.0),)
"""The table of a new controller: numeric registers as integers of 16 bits."""


class AssignmentTable:
    """A table of assignments, of one connection or of all.

    Args:
        entries: The first entries.
    """

    def __init__(self, entries: Collection[Entry] = ()) -> None:
        self.entries = [*entries]

    def command(self, text: str, controller: SnpxController) -> bool:
        """Do what a client's text says; False: it is refused. `CLRASG` is the connection's."""
        match = _SETASG.fullmatch(text.strip())
        if match is None or len(self.entries) >= MOST_ASSIGNMENTS:
            return False
        entry = Entry(int(match[1]), int(match[2]), match[3], float(match[4] or 1.0))
        if not 1 <= entry.first <= entry.first + entry.words - 1 <= LAST_WORD:
            return False
        if element(controller, entry, 0, 0.0) is None:
            return False
        self.entries.append(entry)
        return True

    def words(
        self, controller: SnpxController, first: int, count: int, now_s: float, active: Collection[str]
    ) -> bytes:
        """Return words of %R; those without an assignment are 0.

        Args:
            first: The first word, from 1.
            active: The active faults.
        """
        found = bytearray(_WORD * count)
        # Of two assignments of a word, the earlier one counts.
        for entry in reversed(self.entries):
            begin, end = max(first, entry.first), min(first + count, entry.first + entry.words)
            if begin < end:
                data = _content(controller, entry, begin - entry.first, end - entry.first, now_s, active)
                found[_WORD * (begin - first) : _WORD * (end - first)] = data
        return bytes(found)


def _content(
    controller: SnpxController, entry: Entry, begin: int, end: int, now_s: float, active: Collection[str]
) -> bytes:
    """Return the words of an assignment from `begin` to `end`, counted from its first."""
    size = len(element(controller, entry, 0, now_s, active) or b"") // _WORD or 1
    numbers = range(begin // size, -(-end // size))
    data = b"".join(
        (element(controller, entry, each, now_s, active) or bytes(_WORD * size)) for each in numbers
    )
    at = begin - numbers.start * size
    return data[_WORD * at : _WORD * (at + end - begin)]


def element(
    controller: SnpxController, entry: Entry, number: int, now_s: float, active: Collection[str] = ()
) -> bytes | None:
    """Return one value of an assignment, which may assign several; None: there is no such value.

    Args:
        number: From 0.
    """
    match = _NAME.fullmatch(entry.name)
    if match is None:
        return None
    data = _value(controller, match[1], number, entry.multiply, now_s, active)
    if data is None or match[2] is None:
        return data
    first, count = int(match[2]), int(match[3])
    if not 1 <= first <= first + count - 1 <= len(data) // _WORD:
        return None
    return data[_WORD * (first - 1) : _WORD * (first - 1 + count)]


def _value(
    controller: SnpxController,
    name: str,
    number: int,
    multiply: float,
    now_s: float,
    active: Collection[str],
) -> bytes | None:
    if found := _POSITION.fullmatch(name):
        known = int(found[1] or 1) == controller.group and number == 0
        return controller.position(now_s, active) if known else None
    if found := _TOOL.fullmatch(name):
        tool = int(found[2]) + number
        if int(found[1]) != controller.group or not 1 <= tool <= _TOOLS:
            return None
        return controller.tool() if tool == 1 else bytes(POSITION.size)
    if found := _INDEXED.fullmatch(name):
        index = _NONE if found[2] else int(found[3]) + number
        return _indexed(controller, found[1], index, multiply)
    if name == "$VERSION":
        return SOFTWARE.encode().ljust(_TEXT_BYTES, b"\0") if number == 0 else None
    variable = controller.numbers().get(name)
    return None if variable is None or number else _INTEGER.pack(round(variable * (multiply or 1.0)))


def _indexed(controller: SnpxController, kind: str, index: int, multiply: float) -> bytes:
    match kind:
        case "R":
            value = controller.registers.get(index, 0.0)
            return _INTEGER.pack(round(value * multiply)) if multiply else _FLOAT.pack(value)
        case "SR":
            return bytes(_TEXT_BYTES)
        case "PRG":
            return controller.task(index)
    return controller.alarm(index)


def bits(
    controller: SnpxController, *, outputs: bool, first: int, count: int, active: Collection[str]
) -> bytes:
    """Return bits of inputs or outputs, as bytes; those that do not exist are 0.

    Args:
        first: Number of the first one from 0, a multiple of 8.
        count: A multiple of 8.
    """
    found = controller.inputs()
    if outputs:
        found |= controller.operator_outputs(active) << 6000
    return (found >> first & (1 << count) - 1).to_bytes(count // 8, "little")
