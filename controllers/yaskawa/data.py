"""Data of the answers.

Lengths differ between controllers: FS100 has seven axes, DX100 and later eight; DX200 and later add sub-codes
to alarms. Data of any other length are not used, and missing values are not replaced.
"""

from dataclasses import dataclass
from enum import IntEnum, IntFlag
from struct import Struct

from protocol_gateway.driver_parts.pendant_text import text

_FEWEST_AXES, _MOST_AXES = 6, 8
_WORDS = {count: Struct(f"<{count}i") for count in range(_FEWEST_AXES, _MOST_AXES + 1)}
_POSITION = Struct("<5I")
_TWO = Struct("<2I")
_ALARM = Struct("<3I16s32s")
_ALARM_WITH_SUB_CODES = _ALARM.size + 16 + 96 + 96
_JOB = Struct("<32s3I")
_SYSTEM = Struct("<24s16s8s")
_NAME_BYTES = 4


class DataType(IntEnum):
    """Unit of the numbers of a position."""

    PULSES = 0
    BASE = 16
    ROBOT = 17


@dataclass(frozen=True, slots=True)
class Position:
    """Position of a control group.

    Attributes:
        data_type: See `DataType`; others are those of a user's frame or a tool.
        axes: Six to eight numbers. Pulses of each axis, 0 where there is no axis; or x, y, z [µm], then
            rx, ry, rz and the redundant axis [0.0001 degree].
    """

    data_type: int
    form: int
    tool: int
    user_frame: int
    extended_form: int
    axes: tuple[int, ...]


def position(data: bytes) -> Position:
    """Decode the position of a control group.

    Raises:
        ValueError: If no controller sends data of this length.
    """
    if len(data) < _POSITION.size:
        raise ValueError(f"a position with {len(data)} bytes: must be 44, 48 or 52")
    data_type, form, tool, user_frame, extended_form = _POSITION.unpack_from(data)
    return Position(data_type, form, tool, user_frame, extended_form, _words(data[_POSITION.size :]))


def torques(data: bytes) -> tuple[int, ...]:
    """Decode the torque of each axis [% of the rated torque].

    Raises:
        ValueError: If no controller sends data of this length.
    """
    return _words(data)


def axis_names(data: bytes) -> tuple[str, ...]:
    """Decode the names of a control group's axes: S, L, U, R, B, T, E, W; empty: there is no such axis.

    A name that cannot be read is "?": the axis exists, and a motion could move it.

    Raises:
        ValueError: If no controller sends data of this length.
    """
    if len(data) % _NAME_BYTES or not _FEWEST_AXES <= len(data) // _NAME_BYTES <= _MOST_AXES:
        raise ValueError(f"names of axes with {len(data)} bytes: must be 24, 28 or 32")
    names = [data[at : at + _NAME_BYTES] for at in range(0, len(data), _NAME_BYTES)]
    return tuple((text(each) or "?") if each.strip(b"\0 ") else "" for each in names)


class Status1(IntFlag):
    """First word of the status."""

    STEP = 1 << 0
    ONE_CYCLE = 1 << 1
    CONTINUOUS = 1 << 2
    RUNNING = 1 << 3
    GUARDED = 1 << 4
    TEACH = 1 << 5
    PLAY = 1 << 6
    REMOTE = 1 << 7


class Status2(IntFlag):
    """Second word of the status."""

    HELD_AT_PENDANT = 1 << 1
    HELD_EXTERNALLY = 1 << 2
    HELD_BY_COMMAND = 1 << 3
    ALARM = 1 << 4
    ERROR = 1 << 5
    SERVO_ON = 1 << 6


HELD = Status2.HELD_AT_PENDANT | Status2.HELD_EXTERNALLY | Status2.HELD_BY_COMMAND


@dataclass(frozen=True, slots=True)
class Status:
    """Status of a controller."""

    first: int
    second: int


def status(data: bytes) -> Status:
    """Decode the status.

    Raises:
        ValueError: If its length is wrong.
    """
    return Status(*_TWO.unpack(_exactly(data, _TWO.size, "a status")))


@dataclass(frozen=True, slots=True)
class Alarm:
    """An active alarm.

    Attributes:
        code: Its number; 0: there is no alarm.
        sub_code: Its data; their meaning depends on the alarm.
        kind: How the data are written.
        time: Time of its occurrence by the controller's clock: 2026/11/26 09:30.
    """

    code: int
    sub_code: int
    kind: int
    time: str
    name: str


def alarm(data: bytes) -> Alarm:
    """Decode an alarm.

    Raises:
        ValueError: If no controller sends data of this length.
    """
    if len(data) not in (_ALARM.size, _ALARM_WITH_SUB_CODES):
        sizes = f"{_ALARM.size} or {_ALARM_WITH_SUB_CODES}"
        raise ValueError(f"an alarm with {len(data)} bytes: must be {sizes}")
    code, sub_code, kind, time, name = _ALARM.unpack_from(data)
    return Alarm(code, sub_code, kind, text(time), text(name))


@dataclass(frozen=True, slots=True)
class Job:
    """The executing job.

    Attributes:
        speed_override: Of the speed [0.01 %].
    """

    name: str
    line: int
    step: int
    speed_override: int


def job(data: bytes) -> Job:
    """Decode the executing job.

    Raises:
        ValueError: If its length is wrong.
    """
    name, line, step, override = _JOB.unpack(_exactly(data, _JOB.size, "a job"))
    return Job(text(name), line, step, override)


@dataclass(frozen=True, slots=True)
class System:
    """Versions of the controller's software and parameters, and the robot's model."""

    software: str
    model: str
    parameters: str


def system(data: bytes) -> System:
    """Decode the information on the system.

    Raises:
        ValueError: If its length is wrong.
    """
    parts = _SYSTEM.unpack(_exactly(data, _SYSTEM.size, "the system's information"))
    return System(*map(text, parts))


def io_byte(data: bytes) -> int:
    """Decode eight inputs or outputs, the first in the lowest bit.

    Raises:
        ValueError: If its length is wrong.
    """
    return _exactly(data, 1, "a group of signals")[0]


def _words(data: bytes) -> tuple[int, ...]:
    count, rest = divmod(len(data), 4)
    if rest or count not in _WORDS:
        raise ValueError(f"values of axes with {len(data)} bytes: must be 24, 28 or 32")
    return _WORDS[count].unpack(data)


def _exactly(data: bytes, size: int, what: str) -> bytes:
    if len(data) != size:
        raise ValueError(f"{what} with {len(data)} bytes: must be {size}")
    return data
