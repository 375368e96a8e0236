"""Contents of the files that a controller of FANUC writes of its state, read line by line as they arrive.

Numbers have two or three decimals, and no zero before the point: "-.65". A number that does not fit its field
is stars. Older software has the line CFG: after the six values, newer before them.

A file of a controller is untrusted, and one that has 1 MiB must not stop the gateway. So no turn of the event
loop reads more than one piece of it, and each expression matches a whole line and cannot backtrack over it
more than once.
"""

import math
import re
from collections import deque
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from string import ascii_uppercase
from types import MappingProxyType
from typing import Generic, TypeAlias, TypeVar

from controllers.fanuc.axes import SignalBits
from controllers.fanuc.data import AXES, Cartesian
from protocol_gateway.driver_parts.pendant_text import text as pendant_text

LONGEST_FILE, LONGEST_LINE = 2**20, 2048
"""Most bytes of a file, and of a line in it."""
_HEAD_BYTES = 200
_NUMBER = r"(-?\d{0,9}\.\d{1,9}|-?\d{1,10}|\*{1,20})"
_SOFTWARE = "$VERSION: "
_GROUP = re.compile(r"Group #: +(\d{1,3}) *")
_TITLE = re.compile(r"CURRENT (JOINT|USER FRAME|WORLD) POSITION: *")
_JOINT = re.compile(rf"(Joint|EXTAXS:) +(\d{{1,2}}): *{_NUMBER} *")
_PLACE = re.compile(rf"([XYZWPR]): *{_NUMBER} *")
_CONFIGURATION = re.compile(r"CFG:(.*)")
# An extended axis again, the tool of the next part, the title of the next group.
_AFTER_PLACE = re.compile(rf"EXTAXS: +\d{{1,2}}: *{_NUMBER}|Tool #: +\d{{1,4}}|CURRENT ROBOT POSITION::?")
_FRAME_AND_TOOL = re.compile(r"Frame #: +(\d{1,4}) +Tool #: +(\d{1,4}) *")
_NO_PLACE = "Cartesian position cannot be calculated"
_SIGNAL = re.compile(r"(DIN|DOUT|RI|RO|UI|UO)\[ *(\d{1,5})\] +(ON|OFF)\b")
_SAFETY_TITLE, _SIGNALS_TITLE, _ALARMS_TITLE = "STOP SIGNALS:", "IO STATUS:", "ERRACT.LS "
_TITLE_OF_PART = "[*"
_REGISTERS = "[*NUMREG*]$NUMREG "
_REGISTER = re.compile(rf" *\[(\d{{1,5}})\] = (?:{_NUMBER}|Uninitialized) ")
_TOOLS, _TOOL_NUMBERS = "[*SYSTEM*]$MNUTOOL ", "[*SYSTEM*]$MNUTOOLNUM "
_TOOL = re.compile(
    r" *\[(\d),(\d{1,3})\] = *\n *Group: +\d+ .*\n"
    rf" *X: *{_NUMBER} +Y: *{_NUMBER} +Z: *{_NUMBER} *\n *W: *{_NUMBER} +P: *{_NUMBER} +R: *{_NUMBER} *"
)
_TOOL_LINES = 4
_TOOL_NUMBER = re.compile(r" *\[(\d)\] = (\d{1,3}) *")
_MOST_ALARMS, _MOST_GROUP_LINES = 1000, 200
KINDS: Mapping[str, str] = MappingProxyType({"DI": "DIN", "DO": "DOUT"})
"""Names of inputs and outputs in the file, where the pendant has others."""


Found = TypeVar("Found")
Steps: TypeAlias = Generator[None, str | None, Found]
"""Parser of one file: it gets each line that is not empty, then None, and returns what it found."""


class Reading(Generic[Found]):
    """One file that is read while it arrives.

    Attributes:
        head: Its first bytes, for people.
    """

    def __init__(self, steps: Steps[Found]) -> None:
        self.head = b""
        self._steps = steps
        self._rest = b""
        self._bytes = 0
        self._ended: Found | ValueError | None = None
        self._take(None)  # runs to its first line

    def receive(self, data: bytes) -> None:
        """Read the lines that are complete now.

        Raises:
            ValueError: If the file is too long.
        """
        self.head += data[: _HEAD_BYTES - len(self.head)]
        self._bytes += len(data)
        if self._bytes > LONGEST_FILE:
            raise ValueError(f"a file of more than {LONGEST_FILE >> 20} MiB")
        if self._ended is not None:
            return
        # Lines end with LF, CR LF or CR; the empty ones between CR and LF are left out like all others.
        *lines, self._rest = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        for line in lines:
            self._take(line)
        if len(self._rest) > LONGEST_LINE:
            self._take(self._rest)

    def result(self) -> Found:
        """Return what was found, once the file has ended.

        Raises:
            ValueError: If it is another file, or is not whole.
        """
        self._take(self._rest)
        self._take(None)
        assert self._ended is not None
        if isinstance(self._ended, ValueError):
            raise self._ended
        return self._ended

    def _take(self, line: bytes | None) -> None:
        if self._ended is not None:
            return
        if line is not None and len(line) > LONGEST_LINE:
            self._ended = ValueError(f"a line of more than {LONGEST_LINE} bytes")
        elif line is None or line.strip():
            try:
                self._steps.send(None if line is None else line.decode("latin-1"))
            except StopIteration as end:
                self._ended = end.value
            except ValueError as error:
                self._ended = error


def _after(title: str, otherwise: str) -> Generator[None, str | None, None]:
    """Skip a file's lines until its title.

    Raises:
        ValueError: If it has no title.
    """
    while (line := (yield)) is not None:
        if line.startswith(title):
            return
    raise ValueError(otherwise)


@dataclass(frozen=True, slots=True)
class FilePosition:
    """Current position of a motion group.

    Attributes:
        axes: Nine values [degree] or [mm], 0 where there is no axis; None: a value does not fit its field.
        count: Number of the axes that there are.
        place: Tool in the world frame; None: the controller cannot compute it.
        frame, tool: Numbers of the active user frame and tool; None: the file does not have them.
        software: Version of the controller's software; empty: the file does not have it.
    """

    axes: tuple[float, ...] | None
    count: int
    place: Cartesian | None
    frame: int | None
    tool: int | None
    software: str


def position(group: int) -> Steps[FilePosition]:
    """Read a motion group's position from CURPOS.DG.

    Raises:
        ValueError: If the group is not in the file, or its part is not whole.
    """
    software = ""
    numbers: dict[int, None] = {}
    current = 0
    part: list[str] = []
    while (line := (yield)) is not None:
        if found := _GROUP.fullmatch(line):
            current = int(found[1])
            if current in numbers:
                raise ValueError(f"group {current} is in the file twice")
            numbers[current] = None
        elif numbers and current == group:
            part.append(line)
            if len(part) > _MOST_GROUP_LINES:
                raise ValueError(f"its part of the file has more than {_MOST_GROUP_LINES} lines")
        elif not software and line.startswith(_SOFTWARE):
            software = " ".join(line.removeprefix(_SOFTWARE).split())
    if group not in numbers:
        known = ", ".join(map(str, numbers)) or "none"
        raise ValueError(f"group {group} is not in the file; it has {known}")
    return _position(part, software)


def _position(part: Sequence[str], software: str) -> FilePosition:
    """Return the position in a group's part of the file."""
    titles = [(at, found[1]) for at, line in enumerate(part) if (found := _TITLE.fullmatch(line))]
    if [name for _, name in titles] != ["JOINT", "USER FRAME", "WORLD"]:
        raise ValueError("its part of the file is not whole")
    begins = [at for at, _ in titles]
    joints, user, world = (
        part[begin + 1 : end] for begin, end in zip(begins, [*begins[1:], len(part)], strict=True)
    )
    axes, rest = _axes(joints)
    _place(user)  # not used, but a file with a fault in it is not used either
    numbered = next((found for line in rest if (found := _FRAME_AND_TOOL.fullmatch(line))), None)
    frame, tool = (None, None) if numbered is None else (int(numbered[1]), int(numbered[2]))
    finite = None if any(each is None for each in axes) else tuple(each or 0.0 for each in axes)
    padded = None if finite is None else (*finite, *(0.0,) * (AXES - len(axes)))
    return FilePosition(padded, len(axes), _place(world), frame, tool, software)


def _axes(lines: Sequence[str]) -> tuple[list[float | None], list[str]]:
    """Return the axes of a group, extended ones last, and the lines that are none."""
    found: dict[str, list[float | None]] = {"Joint": [], "EXTAXS:": []}
    rest = []
    for line in lines:
        match = _JOINT.fullmatch(line)
        if match is None:
            if line.startswith(("Joint", "EXTAXS")):
                raise ValueError(f"no axis: {line[:60]!r}")
            rest.append(line)
            continue
        axes = found[match[1]]
        # A line between two axes may be a damaged axis.
        late = rest or (match[1] == "Joint" and found["EXTAXS:"])
        if late or int(match[2]) != len(axes) + 1:
            raise ValueError(f"axes in a wrong order: {line[:60]!r}")
        axes.append(_number(match[3]))
    every = found["Joint"] + found["EXTAXS:"]
    if not found["Joint"] or len(every) > AXES:
        raise ValueError(f"{len(every)} axes: must be 1 to {AXES}")
    return every, rest


def _place(lines: Sequence[str]) -> Cartesian | None:
    values: list[float | None] = []
    configuration = ""
    none = False
    for line in map(str.rstrip, lines):
        if match := _PLACE.fullmatch(line):
            if none or len(values) >= 6 or match[1] != "XYZWPR"[len(values)]:
                raise ValueError(f"a position in a wrong order: {line[:60]!r}")
            values.append(_number(match[2]))
        elif match := _CONFIGURATION.fullmatch(line):
            configuration = match[1].strip()
        elif line == _NO_PLACE:
            none = True
        elif line and _AFTER_PLACE.fullmatch(line) is None:
            raise ValueError(f"no part of a position: {line[:60]!r}")
    if none and not values:
        return None
    if none or len(values) != 6:
        raise ValueError("its part of the file is not whole")
    finite = [each for each in values if each is not None]
    return Cartesian(tuple(finite), configuration) if len(finite) == 6 else None


def _number(text: str) -> float | None:
    return None if text[0] == "*" else float(text)


def inputs_and_outputs() -> Steps[dict[tuple[str, int], bool]]:
    """Read IOSTATE.DG: value by the name in the file, such as "DIN", and the number; others are not assigned.

    Raises:
        ValueError: If it is another file.
    """
    yield from _after(_SIGNALS_TITLE, "it is no list of inputs and outputs")
    known = {}
    while (line := (yield)) is not None:
        if found := _SIGNAL.match(line):
            known[found[1], int(found[2])] = found[3] == "ON"
    return known


def values_of(bits: SignalBits, known: Mapping[tuple[str, int], bool]) -> list[bool | None]:
    """Return inputs or outputs that the site file names; None: not assigned."""
    name = KINDS.get(bits.kind, bits.kind)
    return [known.get((name, number)) for number in range(bits.first, bits.last + 1)]


def safety() -> Steps[dict[str, bool]]:
    """Read SFTYSIG.DG: value by name, such as "TP Enable".

    Raises:
        ValueError: If it is another file.
    """
    yield from _after(_SAFETY_TITLE, "it is no list of stop signals")
    known = {}
    while (line := (yield)) is not None:
        name, _, value = line.rstrip().rpartition("  ")
        if value in ("TRUE", "FALSE") and name.strip():
            known[name.rstrip()] = value == "TRUE"
    return known


@dataclass(frozen=True, slots=True)
class ListedAlarm:
    """An alarm in a list. Its number in the list changes when others come, so it is left out.

    Attributes:
        time: As the controller writes it.
        severity: WARN, PAUSE.L, STOP.G, SERVO, ABORT.G, SYSTEM and others; empty: not reported.
    """

    time: str
    message: str
    cause: str
    severity: str


def active_alarms() -> Steps[list[ListedAlarm]]:
    """Read the active alarms from ERRACT.LS, the newest first.

    Raises:
        ValueError: If it is another file, or a line is not whole.
    """
    head = yield
    if head is None or not head.startswith(_ALARMS_TITLE):
        raise ValueError("it is no list of active alarms")
    found: list[ListedAlarm] = []
    while (line := (yield)) is not None:
        # A text may contain quotation marks.
        fields = line.rstrip().removesuffix('"').split('"')
        severity = _severity(fields[-1])
        if len(fields) < 5 or not fields[0].strip().isdecimal() or severity is None:
            raise ValueError(f"no alarm: {line[:60]!r}")
        message, cause = _text(fields[2]), _text('"'.join(fields[3:-1]))
        found.append(ListedAlarm(fields[1].strip(), message, cause, severity))
        if len(found) > _MOST_ALARMS:
            raise ValueError(f"more than {_MOST_ALARMS} active alarms")
    return found


def _severity(field: str) -> str | None:
    """Return the severity before the eight binary digits of an alarm's last field; None: it is another."""
    before, blank, digits = field.rpartition(" ")
    severity = before.strip(" ")
    whole = blank and len(digits) == 8 and not digits.strip("01")
    return severity if whole and not severity.strip(ascii_uppercase + ".") else None


def _text(latin: str) -> str:
    return pendant_text(latin.encode("latin-1"))


def registers() -> Steps[dict[int, float | None]]:
    """Read NUMREG.VA: value by number; None: it has none.

    Raises:
        ValueError: If it is another file.
    """
    yield from _after(_REGISTERS, "it has no registers")
    known = {}
    while (line := (yield)) is not None and not line.startswith(_TITLE_OF_PART):
        if found := _REGISTER.match(line):
            known[int(found[1])] = None if found[2] is None else _number(found[2])
    return known


@dataclass(frozen=True, slots=True)
class Tools:
    """Tools of a motion group.

    Attributes:
        active: Number of the active tool; None: the file does not have it.
        frames: Frame in that of the flange, by number.
    """

    active: int | None
    frames: Mapping[int, Cartesian]


def tools(group: int) -> Steps[Tools]:
    """Read a group's tools from SYSFRAME.VA.

    Raises:
        ValueError: If it is another file.
    """
    frames = {}
    active: int | None = None
    title = ""
    titles = set()
    newest: deque[str] = deque(maxlen=_TOOL_LINES)
    while (line := (yield)) is not None:
        newest.append(line)
        if line.startswith(_TITLE_OF_PART):
            title = next((each for each in (_TOOLS, _TOOL_NUMBERS) if line.startswith(each)), "")
            titles.add(title)
        elif title == _TOOLS and (found := _TOOL.fullmatch("\n".join(newest))):
            values = tuple(
                math.nan if (value := _number(text)) is None else value for text in found.groups()[2:]
            )
            if int(found[1]) == group and all(map(math.isfinite, values)):
                frames[int(found[2])] = Cartesian(values, "")
        elif title == _TOOL_NUMBERS and active is None and (found := _TOOL_NUMBER.fullmatch(line)):
            active = int(found[2]) if int(found[1]) == group else None
    for each, missing in ((_TOOLS, "tool frames"), (_TOOL_NUMBERS, "number of the active tool")):
        if each not in titles:
            raise ValueError(f"it has no {missing}")
    return Tools(active, frames)
