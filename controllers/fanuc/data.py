"""Values that assignments put into words: positions, alarms, tasks. Numbers are little-endian."""

import math
import re
from dataclasses import dataclass
from struct import Struct

from protocol_gateway.driver_parts.pendant_text import text

AXES = 9
POSITION = Struct("<9f8h9f6h")
"""X, Y, Z, W, P, R, E1 to E3; configuration, turns, validity; J1 to J9; validity; frame, tool, 3 reserved."""
_CARTESIAN = Struct("<9f8h")
ALARM = Struct("<11h80s80s18s")
TASK = Struct("<16s2h16s")
_NUMBER, _INTEGER = Struct("<f"), Struct("<i")
# Names of three letters are padded: "JOG -010".
_CODE = re.compile(r"([A-Z][A-Z0-9]{1,4}) ?-(\d{3,4})")


@dataclass(frozen=True, slots=True)
class Cartesian:
    """A Cartesian position.

    Attributes:
        values: x, y, z [mm], and w, p, r [degree]: angles about the fixed axes x, y, z, in this order.
        configuration: As on the pendant: N or F (wrist), R or L (arm), D or U (elbow), B or T (front), and
            the turns of three joints.
    """

    values: tuple[float, ...]
    configuration: str


@dataclass(frozen=True, slots=True)
class Position:
    """Current position. Invalid or infinite parts are None.

    Attributes:
        axes: Nine values [degree] or [mm], 0 where there is no axis.
    """

    cartesian: Cartesian | None
    axes: tuple[float, ...] | None


def position(data: bytes) -> Position:
    """Decode a position of 100 bytes."""
    values = POSITION.unpack(data)
    axes = values[17:26]
    valid = values[26] != 0 and all(map(math.isfinite, axes))
    return Position(cartesian(data[: _CARTESIAN.size]), axes if valid else None)


def cartesian(data: bytes) -> Cartesian | None:
    """Decode a Cartesian position of 52 bytes; None: it is not valid, or not finite."""
    values = _CARTESIAN.unpack(data)
    if not values[16] or not all(map(math.isfinite, values[:6])):
        return None
    letters = " ".join(
        pair[bool(each)] for pair, each in zip(("NF", "RL", "DU", "BT"), values[9:13], strict=True)
    )
    return Cartesian(values[:6], ", ".join((letters, *map(str, values[13:16]))))


@dataclass(frozen=True, slots=True)
class Alarm:
    """An active alarm.

    Attributes:
        facility, code: Both numbers of its code; 0, 0: there is no alarm.
        severity: The controller's number of the severity.
        severity_name: WARN, PAUSE.L, STOP.G, SERVO, ABORT.G, SYSTEM and others; empty: not reported.
        time: Year to second on the controller's clock.
    """

    facility: int
    code: int
    severity: int
    time: tuple[int, ...]
    message: str
    cause: str
    severity_name: str

    @property
    def exists(self) -> bool:
        """True unless the line is empty."""
        return (self.facility, self.code) != (0, 0)

    @property
    def number(self) -> str:
        """Code as on the pendant, such as SRVO-001."""
        found = _CODE.match(self.message)
        return "-".join(found.groups()) if found else f"{self.facility}-{self.code:03d}"

    @property
    def full_message(self) -> str:
        """Message that begins with its code."""
        return self.message if _CODE.match(self.message) else f"{self.number} {self.message}".rstrip()


def alarms(data: bytes) -> list[Alarm]:
    """Decode active alarms of 200 bytes each, the newest first; empty lines are left out."""
    found = []
    for at in range(0, len(data), ALARM.size):
        facility, code, _, _, severity, *rest = ALARM.unpack_from(data, at)
        time, (message, cause, name) = tuple(rest[:6]), map(text, rest[6:])
        found.append(Alarm(facility, code, severity, time, message, cause, name))
    return [each for each in found if each.exists]


@dataclass(frozen=True, slots=True)
class Task:
    """The program of a task.

    Attributes:
        state: 0: ended, 1: paused, 2: running.
    """

    program: str
    line: int
    state: int
    caller: str


def task(data: bytes) -> Task:
    """Decode a task of 36 bytes."""
    program, line, state, caller = TASK.unpack(data)
    return Task(text(program), line, state, text(caller))


def number(data: bytes) -> float:
    """Decode a floating-point number; it may be infinite or not a number."""
    found: float = _NUMBER.unpack(data)[0]
    return found


def integer(data: bytes) -> int:
    """Decode an integer of 32 bits."""
    found: int = _INTEGER.unpack(data)[0]
    return found
