"""Messages of the primary interface, read only; big-endian, without I/O.

A package is int32 length, uint8 type, payload. Robot messages (type 20) carry alarms, keys of the program and
texts; every other type, such as the state ten times a second, is skipped, since RTDE gives it better.

    robot message = uint64 time, int8 source, uint8 kind, then by kind:
      0 text               text
      2 popup              uint32 request, uint32 type, warning, error, blocking, uint8 length, title, text
      3 version            uint8 length, name, uint8 major, uint8 minor, int32 bugfix, int32 build, date
      5 safety mode        int32 code, int32 argument, uint8 mode, uint32 type and 4 bytes of data
      6 error code         int32 code, int32 argument, int32 level, uint32 type and 4 bytes of data, text
      7 key                int32 code, int32 argument, uint8 length, title, text
      10 runtime exception int32 line, int32 column, text

A text ends with the package.
"""

import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeAlias

from controllers.universal_robots.interfaces.packages import (
    Malformed,
    Package,
    PackageStream,
)
from protocol_gateway.driver_parts.hexadecimal import hexadecimal
from robomesh.texts import one_line

ROBOT_MESSAGE = 20
HEADER = struct.Struct(">iB")

LONGEST_MESSAGE_BYTES = 64 * 1024
# The longest skipped packages list a program's variables.
LONGEST_SKIPPED_BYTES = 1024 * 1024
LONGEST_TEXT = 1000

_MESSAGE = struct.Struct(">QbB")
_CODE = struct.Struct(">ii")
_ERROR = struct.Struct(">iiiII")
_SAFETY_MODE = struct.Struct(">iiBII")
_VERSION = struct.Struct(">BBii")
_POPUP = struct.Struct(">II???")


@dataclass(frozen=True, slots=True)
class Origin:
    """Origin of a robot message.

    Attributes:
        time: Time on the controller's clock, in its own unit: microseconds in the recorded streams.
        source: Number of the part that sent it: 0 to 5 joints, 6 tool, negative ones the controller's parts.
    """

    time: int
    source: int


@dataclass(frozen=True, slots=True)
class PrimaryText:
    """Text of a program (`textmsg`) or of the controller."""

    origin: Origin
    text: str


@dataclass(frozen=True, slots=True)
class Popup:
    """Popup on the teach pendant."""

    origin: Origin
    title: str
    text: str
    warning: bool
    error: bool
    blocking: bool


@dataclass(frozen=True, slots=True)
class PrimaryVersion:
    """Version of the controller's software; the first message of a connection."""

    origin: Origin
    name: str
    major: int
    minor: int
    bugfix: int
    build: int
    date: str


@dataclass(frozen=True, slots=True)
class SafetyModeChanged:
    """Change of the safety mode, see `SafetyMode`, with the alarm's code and argument."""

    origin: Origin
    code: int
    argument: int
    mode: int


@dataclass(frozen=True, slots=True)
class Alarm:
    """Alarm.

    Attributes:
        code, argument: C and A in UR's list of error codes.
        level: Severity, see `ReportLevel`.
        data_type: Kind of `data`, 0: none.
        data: 4 bytes of data.
        text: Text of the controller; often empty, because the pendant takes it from the code.
    """

    origin: Origin
    code: int
    argument: int
    level: int
    data_type: int
    data: int
    text: str

    @property
    def name(self) -> str:
        """Code and argument as UR's list of error codes writes them: `C153A0`."""
        return f"C{self.code}A{self.argument}"


@dataclass(frozen=True, slots=True)
class KeyMessage:
    """Event of a program, such as the title `PROGRAM_XXX_STARTED` with the program's name as its text."""

    origin: Origin
    code: int
    argument: int
    title: str
    text: str


@dataclass(frozen=True, slots=True)
class RuntimeFault:
    """Fault in the running script."""

    origin: Origin
    line: int
    column: int
    text: str


PrimaryMessage: TypeAlias = (
    PrimaryText | Popup | PrimaryVersion | SafetyModeChanged | Alarm | KeyMessage | RuntimeFault
)
PrimaryEvent: TypeAlias = PrimaryMessage | Malformed


class PrimaryStream:
    """Parser of the controller's side of one connection.

    Attributes:
        ignored: Robot messages of other kinds.
    """

    def __init__(self) -> None:
        self._packages = PackageStream(
            HEADER.format,
            longest=LONGEST_MESSAGE_BYTES,
            skip=lambda kind: kind != ROBOT_MESSAGE,
            longest_skipped=LONGEST_SKIPPED_BYTES,
        )
        self.ignored = 0

    @property
    def lost(self) -> bool:
        """True after a fatal event."""
        return self._packages.lost

    @property
    def skipped(self) -> int:
        """Number of skipped packages, such as states."""
        return self._packages.skipped

    def receive(self, data: bytes) -> Sequence[PrimaryEvent]:
        """Return the events of the next bytes, split anywhere."""
        events: list[PrimaryEvent] = []
        for package in self._packages.receive(data):
            event = package if isinstance(package, Malformed) else self._read(package)
            if event is not None:
                events.append(event)
        return events

    def _read(self, package: Package) -> PrimaryEvent | None:
        try:
            time, source, kind = _unpack(_MESSAGE, package.payload)
            reader = _READERS.get(kind)
            if reader is None:
                self.ignored += 1
                return None
            return reader(Origin(time, source), package.payload[_MESSAGE.size :])
        except ValueError as error:
            data = HEADER.pack(HEADER.size + len(package.payload), package.type) + package.payload
            return Malformed(package.offset, hexadecimal(data), str(error))


def _unpack(layout: struct.Struct, data: bytes) -> tuple[int, ...]:
    if len(data) < layout.size:
        raise ValueError(f"a robot message ends after {len(data)} bytes of a part of {layout.size}")
    return layout.unpack_from(data)


def _text(data: bytes) -> str:
    return one_line(data.decode("utf-8", "replace"), LONGEST_TEXT)


def _counted(data: bytes) -> tuple[str, bytes]:
    if not data or len(data) - 1 < data[0]:
        raise ValueError("a title is longer than its message")
    return _text(data[1 : 1 + data[0]]), data[1 + data[0] :]


def _read_text(origin: Origin, data: bytes) -> PrimaryText:
    return PrimaryText(origin, _text(data))


def _read_popup(origin: Origin, data: bytes) -> Popup:
    _, _, warning, error, blocking = _unpack(_POPUP, data)
    title, text = _counted(data[_POPUP.size :])
    return Popup(origin, title, _text(text), bool(warning), bool(error), bool(blocking))


def _read_version(origin: Origin, data: bytes) -> PrimaryVersion:
    name, rest = _counted(data)
    major, minor, bugfix, build = _unpack(_VERSION, rest)
    return PrimaryVersion(origin, name, major, minor, bugfix, build, _text(rest[_VERSION.size :]))


def _read_safety_mode(origin: Origin, data: bytes) -> SafetyModeChanged:
    code, argument, mode, _, _ = _unpack(_SAFETY_MODE, data)
    return SafetyModeChanged(origin, code, argument, mode)


def _read_alarm(origin: Origin, data: bytes) -> Alarm:
    code, argument, level, data_type, value = _unpack(_ERROR, data)
    return Alarm(origin, code, argument, level, data_type, value, _text(data[_ERROR.size :]))


def _read_key(origin: Origin, data: bytes) -> KeyMessage:
    code, argument = _unpack(_CODE, data)
    title, text = _counted(data[_CODE.size :])
    return KeyMessage(origin, code, argument, title, _text(text))


def _read_runtime_fault(origin: Origin, data: bytes) -> RuntimeFault:
    line, column = _unpack(_CODE, data)
    return RuntimeFault(origin, line, column, _text(data[_CODE.size :]))


_READERS: Mapping[int, Callable[[Origin, bytes], PrimaryMessage]] = MappingProxyType(
    {
        0: _read_text,
        2: _read_popup,
        3: _read_version,
        5: _read_safety_mode,
        6: _read_alarm,
        7: _read_key,
        10: _read_runtime_fault,
    }
)
