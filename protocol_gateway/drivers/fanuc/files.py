"""Contents of the files that a controller of FANUC writes of its state.

Numbers have two or three decimals, and no zero before the point: "-.65". A number that does not fit its field
is stars. Older software has the line CFG: after the six values, newer before them.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from protocol_gateway.drivers.fanuc.axes import SignalBits
from protocol_gateway.drivers.fanuc.data import AXES, Cartesian
from protocol_gateway.drivers.pendant_text import text as pendant_text

_NUMBER = r"(-?\d{0,9}\.\d{1,9}|-?\d{1,10}|\*{1,20})"
_SOFTWARE = re.compile(r"^\$VERSION: +(\S.*?) *$", re.MULTILINE)
_GROUP = re.compile(r"^Group #: +(\d{1,3}) *$", re.MULTILINE)
_TITLE = re.compile(r"^CURRENT (JOINT|USER FRAME|WORLD) POSITION: *$", re.MULTILINE)
_JOINT = re.compile(rf"(Joint|EXTAXS:) +(\d{{1,2}}): *{_NUMBER} *")
_PLACE = re.compile(rf"([XYZWPR]): *{_NUMBER} *")
_CONFIGURATION = re.compile(r"CFG:(.*)")
# An extended axis again, the tool of the next part, the title of the next group.
_AFTER_PLACE = re.compile(rf"EXTAXS: +\d{{1,2}}: *{_NUMBER}|Tool #: +\d{{1,4}}|CURRENT ROBOT POSITION::?")
_FRAME_AND_TOOL = re.compile(r"Frame #: +(\d{1,4}) +Tool #: +(\d{1,4}) *")
_NO_PLACE = "Cartesian position cannot be calculated"
_SIGNAL = re.compile(r"^(DIN|DOUT|RI|RO|UI|UO)\[ *(\d{1,5})\] +(ON|OFF)\b", re.MULTILINE)
_SAFETY = re.compile(r"^(\S.*?) {2,}(TRUE|FALSE) *$", re.MULTILINE)
_SAFETY_TITLE = re.compile(r"^STOP SIGNALS::? *$", re.MULTILINE)
_SIGNALS_TITLE = re.compile(r"^IO STATUS::? *$", re.MULTILINE)
_ALARMS_TITLE = "ERRACT.LS "
_SEVERITY = re.compile(r" *([A-Z.]*) +[01]{8}")
_REGISTERS = "[*NUMREG*]$NUMREG "
_REGISTER = re.compile(rf"^ *\[(\d{{1,5}})\] = (?:{_NUMBER}|Uninitialized) ", re.MULTILINE)
_TOOLS = "[*SYSTEM*]$MNUTOOL "
_TOOL = re.compile(
    r"^ *\[(\d),(\d{1,3})\] = *\n *Group: +\d+ .*\n"
    rf" *X: *{_NUMBER} +Y: *{_NUMBER} +Z: *{_NUMBER} *\n *W: *{_NUMBER} +P: *{_NUMBER} +R: *{_NUMBER} *$",
    re.MULTILINE,
)
_TOOL_NUMBERS = "[*SYSTEM*]$MNUTOOLNUM "
_TOOL_NUMBER = re.compile(r"^ *\[(\d)\] = (\d{1,3}) *$", re.MULTILINE)
_MOST_ALARMS = 1000
KINDS: Mapping[str, str] = MappingProxyType({"DI": "DIN", "DO": "DOUT"})
"""Names of inputs and outputs in the file, where the pendant has others."""


def lines_of(data: bytes) -> str:
    """Return a file's text, with one newline after each line."""
    return data.decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")


def software(file: str) -> str:
    """Return the version of the software, from the head of most files, or an empty text."""
    found = _SOFTWARE.search(file)
    return " ".join(found[1].split()) if found else ""


@dataclass(frozen=True, slots=True)
class FilePosition:
    """Current position of a motion group.

    Attributes:
        axes: Nine values [degree] or [mm], 0 where there is no axis; None: a value does not fit its field.
        count: Number of the axes that there are.
        place: Tool in the world frame; None: the controller cannot compute it.
        frame, tool: Numbers of the active user frame and tool; None: the file does not have them.
    """

    axes: tuple[float, ...] | None
    count: int
    place: Cartesian | None
    frame: int | None
    tool: int | None


def position(file: str, group: int) -> FilePosition:
    """Read a motion group's position from CURPOS.DG.

    Raises:
        ValueError: If the group is not in the file, or its part is not whole.
    """
    begins = [*_GROUP.finditer(file)]
    numbers = [int(each[1]) for each in begins]
    if group not in numbers:
        known = ", ".join(map(str, numbers)) or "none"
        raise ValueError(f"group {group} is not in the file; it has {known}")
    if numbers.count(group) > 1:
        raise ValueError(f"group {group} is in the file twice")
    at = numbers.index(group)
    end = begins[at + 1].start() if at + 1 < len(begins) else len(file)
    part = file[begins[at].end() : end]
    titles = [*_TITLE.finditer(part)]
    names = [each[1] for each in titles]
    if names != ["JOINT", "USER FRAME", "WORLD"]:
        raise ValueError("its part of the file is not whole")
    joints, user, world = (
        part[begin.end() : following].split("\n")
        for begin, following in zip(titles, [*(each.start() for each in titles[1:]), len(part)], strict=True)
    )
    axes, rest = _axes(joints)
    _place(user)  # not used, but a file with a fault in it is not used either
    numbered = next((found for line in rest if (found := _FRAME_AND_TOOL.fullmatch(line))), None)
    frame, tool = (None, None) if numbered is None else (int(numbered[1]), int(numbered[2]))
    finite = None if any(each is None for each in axes) else tuple(each or 0.0 for each in axes)
    padded = None if finite is None else (*finite, *(0.0,) * (AXES - len(axes)))
    return FilePosition(padded, len(axes), _place(world), frame, tool)


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
        if int(match[2]) != len(axes) + 1 or (match[1] == "Joint" and found["EXTAXS:"]):
            raise ValueError(f"axes in a wrong order: {line[:60]!r}")
        axes.append(_number(match[3]))
    every = found["Joint"] + found["EXTAXS:"]
    if not found["Joint"] or len(every) > AXES:
        raise ValueError(f"{len(every)} axes; 1 to {AXES} are right")
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


def inputs_and_outputs(file: str) -> dict[tuple[str, int], bool]:
    """Read IOSTATE.DG: value by the name in the file, such as "DIN", and the number; others are not assigned.

    Raises:
        ValueError: If it is another file.
    """
    title = _SIGNALS_TITLE.search(file)
    if title is None:
        raise ValueError("it is no list of inputs and outputs")
    return {(each[1], int(each[2])): each[3] == "ON" for each in _SIGNAL.finditer(file, title.end())}


def values_of(bits: SignalBits, known: Mapping[tuple[str, int], bool]) -> list[bool | None]:
    """Return inputs or outputs that the site file names; None: not assigned."""
    name = KINDS.get(bits.kind, bits.kind)
    return [known.get((name, number)) for number in range(bits.first, bits.last + 1)]


def safety(file: str) -> dict[str, bool]:
    """Read SFTYSIG.DG: value by name, such as "TP Enable".

    Raises:
        ValueError: If it is another file.
    """
    title = _SAFETY_TITLE.search(file)
    if title is None:
        raise ValueError("it is no list of stop signals")
    return {each[1]: each[2] == "TRUE" for each in _SAFETY.finditer(file, title.end())}


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


def active_alarms(file: str) -> list[ListedAlarm]:
    """Read the active alarms from ERRACT.LS, the newest first.

    Raises:
        ValueError: If it is another file, or a line is not whole.
    """
    head, *lines = file.split("\n")
    if not head.startswith(_ALARMS_TITLE):
        raise ValueError("it is no list of active alarms")
    found = []
    for line in filter(str.strip, lines):
        # A text may contain quotation marks.
        fields = line.rstrip().removesuffix('"').split('"')
        severity = _SEVERITY.fullmatch(fields[-1])
        if len(fields) < 5 or not fields[0].strip().isdecimal() or severity is None:
            raise ValueError(f"no alarm: {line[:60]!r}")
        message, cause = _text(fields[2]), _text('"'.join(fields[3:-1]))
        found.append(ListedAlarm(fields[1].strip(), message, cause, severity[1]))
        if len(found) > _MOST_ALARMS:
            raise ValueError(f"more than {_MOST_ALARMS} active alarms")
    return found


def _text(latin: str) -> str:
    return pendant_text(latin.encode("latin-1"))


def registers(file: str) -> dict[int, float | None]:
    """Read NUMREG.VA: value by number; None: it has none.

    Raises:
        ValueError: If it is another file.
    """
    part = _variable(file, _REGISTERS, "it has no registers")
    return {int(each[1]): None if each[2] is None else _number(each[2]) for each in _REGISTER.finditer(part)}


@dataclass(frozen=True, slots=True)
class Tools:
    """Tools of a motion group.

    Attributes:
        active: Number of the active tool; None: the file does not have it.
        frames: Frame in that of the flange, by number.
    """

    active: int | None
    frames: Mapping[int, Cartesian]


def tools(file: str, group: int) -> Tools:
    """Read a group's tools from SYSFRAME.VA.

    Raises:
        ValueError: If it is another file.
    """
    frames = {}
    for each in _TOOL.finditer(_variable(file, _TOOLS, "it has no tool frames")):
        values = tuple(math.nan if (value := _number(text)) is None else value for text in each.groups()[2:])
        if int(each[1]) == group and all(map(math.isfinite, values)):
            frames[int(each[2])] = Cartesian(values, "")
    numbers = _variable(file, _TOOL_NUMBERS, "it has no number of the active tool")
    active = next((int(each[2]) for each in _TOOL_NUMBER.finditer(numbers) if int(each[1]) == group), None)
    return Tools(active, frames)


def _variable(file: str, title: str, otherwise: str) -> str:
    """Return the part of a file with a variable's values."""
    begin = file.find(title)
    if begin < 0:
        raise ValueError(otherwise)
    end = file.find("\n[*", begin)
    return file[begin:] if end < 0 else file[begin:end]
