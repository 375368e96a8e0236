"""Messages of RTDE (Real-Time Data Exchange), protocol versions 1 and 2; big-endian, without I/O.

| letter | package | to the controller | from the controller |
|---|---|---|---|
| V | protocol version | uint16 version | uint8 accepted |
| v | version of URControl | - | 4 uint32 |
| O | set up outputs | [double Hz,] names | [uint8 recipe,] types |
| I | set up inputs | names | uint8 recipe, types |
| S, P | start, pause | - | uint8 accepted |
| U | data | uint8 recipe, values | [uint8 recipe,] values |
| M | text | as from the controller | see `TextReceived` |

Version 1 has no parts in brackets. Names and types are ASCII, separated by commas. A type is NOT_FOUND for an
unknown name, and IN_USE for an input that another client writes.
"""

import math
import struct
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import accumulate
from types import MappingProxyType
from typing import TypeAlias

from controllers.universal_robots.interfaces.packages import (
    Malformed,
    Package,
    PackageStream,
)
from protocol_gateway.driver_parts.hexadecimal import hexadecimal
from robomesh.texts import one_line

# A recipe of all fields that robomesh reads takes less than 1 KiB. A header could announce 65,535 bytes, for
# which a reader would wait while it reads the packages in between as a part of it.
LONGEST_PACKAGE_BYTES = 4096
LONGEST_NAMES_BYTES = 2048
"""The controllers' limit of the names of a recipe, with their commas."""

NOT_FOUND = "NOT_FOUND"
IN_USE = "IN_USE"

HEADER = struct.Struct(">HB")
_FREQUENCY = struct.Struct(">d")
_VERSION = struct.Struct(">4I")

FORMATS: Mapping[str, str] = MappingProxyType(
    {
        "BOOL": "?",
        "UINT8": "B",
        "UINT32": "I",
        "UINT64": "Q",
        "INT32": "i",
        "DOUBLE": "d",
        "VECTOR3D": "3d",
        "VECTOR6D": "6d",
        "VECTOR6INT32": "6i",
        "VECTOR6UINT32": "6I",
    }
)
"""Format of each type for `struct`."""

Value: TypeAlias = float | int | bool | tuple[float, ...] | tuple[int, ...]


class PackageType(IntEnum):
    """Type of a package."""

    PROTOCOL_VERSION = ord("V")
    URCONTROL_VERSION = ord("v")
    TEXT = ord("M")
    DATA = ord("U")
    SET_UP_OUTPUTS = ord("O")
    SET_UP_INPUTS = ord("I")
    START = ord("S")
    PAUSE = ord("P")


# ------------------------------------------------------------ messages from a controller


@dataclass(frozen=True, slots=True)
class ProtocolVersionAnswered:
    """Answer to the request of a protocol version."""

    accepted: bool


@dataclass(frozen=True, slots=True)
class ControllerVersion:
    """Version of the controller's software, URControl: 3 is CB3, 5 e-Series, 10 PolyScope X."""

    major: int
    minor: int
    bugfix: int
    build: int

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}.{self.bugfix}.{self.build}"

    @property
    def highest_hz(self) -> float:
        """Highest output frequency: that of the control loop."""
        return 125.0 if self.major < 5 else 500.0


@dataclass(frozen=True, slots=True)
class OutputsSetUp:
    """Answer to a set-up of outputs.

    Attributes:
        recipe_id: Number in the data packages; None with version 1.
        types: One a requested name; NOT_FOUND: the controller does not know the name, and the set-up is void.
    """

    recipe_id: int | None
    types: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class InputsSetUp:
    """Answer to a set-up of inputs.

    Attributes:
        recipe_id: Number for the data packages to the controller.
        types: One a requested name; NOT_FOUND: unknown, IN_USE: another client writes it.
    """

    recipe_id: int
    types: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class StartAnswered:
    """Answer to a start."""

    accepted: bool


@dataclass(frozen=True, slots=True)
class PauseAnswered:
    """Answer to a pause."""

    accepted: bool


@dataclass(frozen=True, slots=True)
class TextReceived:
    """Text message: uint8 length and text, the same for the source, uint8 level; version 1: level and text.

    Attributes:
        level: A `TextLevel`, or a value that it does not list.
        text: On one line, at most 255 characters.
        source: Its sender; empty with version 1.
    """

    level: int
    text: str
    source: str


@dataclass(frozen=True, slots=True)
class DataReceived:
    """Values of a recipe by the names of the fields; all are finite."""

    values: Mapping[str, Value]


RtdeMessage: TypeAlias = (
    ProtocolVersionAnswered
    | ControllerVersion
    | OutputsSetUp
    | InputsSetUp
    | StartAnswered
    | PauseAnswered
    | TextReceived
    | DataReceived
)
RtdeEvent: TypeAlias = RtdeMessage | Malformed


class Recipe:
    """Format of data packages.

    Args:
        names: Names of the fields.
        types: One a name, keys of `FORMATS`.
        recipe_id: Number in the packages; None with version 1.
        needed: Names whose values must be finite; others are left out if they are not. None: all.

    Raises:
        ValueError: If the numbers of names and types differ, or a type is unknown.
    """

    def __init__(
        self,
        names: Sequence[str],
        types: Sequence[str],
        recipe_id: int | None,
        *,
        needed: Collection[str] | None = None,
    ) -> None:
        if len(names) != len(types):
            raise ValueError(f"{len(types)} types for {len(names)} fields")
        if unknown := [each for each in types if each not in FORMATS]:
            raise ValueError(f"type {unknown[0]} is unknown")
        self.names = tuple(names)
        self.types = tuple(types)
        self.recipe_id = recipe_id
        self._needed = frozenset(names if needed is None else needed)
        self._values = struct.Struct(">" + "".join(FORMATS[each] for each in types))
        counts = [int(FORMATS[each][:-1] or 1) for each in types]
        self._places = tuple(zip(names, accumulate(counts, initial=0), counts, strict=False))
        self._size = self._values.size + (recipe_id is not None)

    def read(self, payload: bytes) -> Mapping[str, Value]:
        """Return the values of a data package's payload.

        Raises:
            ValueError: If size or number of the recipe differ, or a needed value is not finite.
        """
        if self.recipe_id is not None and payload[:1] != bytes([self.recipe_id]):
            number = payload[0] if payload else "none"
            raise ValueError(f"recipe {number}, set up is recipe {self.recipe_id}")
        if len(payload) != self._size:
            raise ValueError(f"{len(payload)} bytes of data, the recipe has {self._size}")
        flat = self._values.unpack_from(payload, self._size - self._values.size)
        places = self._places
        if not all(map(math.isfinite, flat)):
            places = tuple(
                (name, begin, count)
                for name, begin, count in places
                if all(map(math.isfinite, flat[begin : begin + count]))
            )
            if missing := self._needed.difference(name for name, _, _ in places):
                raise ValueError(f"{min(missing)} is not finite")
        return {
            name: flat[begin] if count == 1 else flat[begin : begin + count] for name, begin, count in places
        }

    def write(self, values: Mapping[str, Value]) -> bytes:
        """Return the payload of a data package.

        Raises:
            KeyError: If the value of a field is missing.
            struct.error: If a value does not fit its type.
        """
        flat = [
            each
            for name, _, count in self._places
            for each in ((values[name],) if count == 1 else tuple(values[name]))  # type: ignore[arg-type]
        ]
        number = b"" if self.recipe_id is None else bytes([self.recipe_id])
        return number + self._values.pack(*flat)


class RtdeStream:
    """Parser of the controller's side of one connection.

    Attributes:
        version: Negotiated protocol version, 1 or 2; set it as soon as version 2 is accepted.
        recipe: Recipe of the data packages; None before the set-up.
        lost: The stream cannot be read any further.
    """

    def __init__(self) -> None:
        self._packages = PackageStream(HEADER.format, longest=LONGEST_PACKAGE_BYTES)
        self.version = 1
        self.recipe: Recipe | None = None

    @property
    def lost(self) -> bool:
        """True after a fatal event."""
        return self._packages.lost

    def receive(self, data: bytes) -> list[Package | Malformed]:
        """Return the packages that these bytes complete; `decode` each before the next."""
        return self._packages.receive(data)

    def decode(self, package: Package) -> RtdeEvent:
        """Return a package's message, as version and recipe say at this moment."""
        try:
            return self._message(package.type, package.payload)
        except ValueError as error:
            text = hexadecimal(
                HEADER.pack(len(package.payload) + HEADER.size, package.type) + package.payload
            )
            return Malformed(package.offset, text, str(error))

    def _message(self, kind: int, payload: bytes) -> RtdeMessage:
        match kind:
            case PackageType.DATA:
                if self.recipe is None:
                    raise ValueError("data before a set-up of outputs")
                return DataReceived(self.recipe.read(payload))
            case PackageType.PROTOCOL_VERSION:
                return ProtocolVersionAnswered(_accepted(payload))
            case PackageType.URCONTROL_VERSION:
                if len(payload) != _VERSION.size:
                    raise ValueError(f"{len(payload)} bytes of a version: must be 16")
                return ControllerVersion(*_VERSION.unpack(payload))
            case PackageType.SET_UP_OUTPUTS:
                numbered = self.version > 1
                if numbered and not payload:
                    raise ValueError("an answer without a recipe")
                return OutputsSetUp(payload[0] if numbered else None, _types(payload[numbered:]))
            case PackageType.SET_UP_INPUTS:
                if not payload:
                    raise ValueError("an answer without a recipe")
                return InputsSetUp(payload[0], _types(payload[1:]))
            case PackageType.START:
                return StartAnswered(_accepted(payload))
            case PackageType.PAUSE:
                return PauseAnswered(_accepted(payload))
            case PackageType.TEXT:
                return read_text(payload, self.version)
            case _:
                raise ValueError(f"a package of unknown type {kind}")


def _accepted(payload: bytes) -> bool:
    if len(payload) != 1 or payload[0] > 1:
        raise ValueError(f"answer {payload[:8].hex(' ') or 'without a byte'}: must be 00 or 01")
    return payload == b"\x01"


def _types(data: bytes) -> tuple[str, ...]:
    types = tuple(data.decode("ascii", "backslashreplace").split(","))
    for each in types:
        if each not in FORMATS and each not in (NOT_FOUND, IN_USE):
            raise ValueError(f"type {one_line(each, 24)!r} is unknown")
    return types


def read_text(payload: bytes, version: int) -> TextReceived:
    """Parse a text message.

    Raises:
        ValueError: If its lengths do not fit.
    """
    if version < 2:
        if not payload:
            raise ValueError("a text without a level")
        return TextReceived(payload[0], _text(payload[1:]), "")
    text, rest = _counted(payload)
    source, level = _counted(rest)
    if len(level) != 1:
        raise ValueError(f"{len(level)} bytes after the texts: must be 1")
    return TextReceived(level[0], _text(text), _text(source))


def _counted(data: bytes) -> tuple[bytes, bytes]:
    if not data or len(data) - 1 < data[0]:
        raise ValueError("a text is shorter than its length says")
    return data[1 : 1 + data[0]], data[1 + data[0] :]


def _text(data: bytes) -> str:
    return one_line(data.decode("utf-8", "replace"), 255)


# ------------------------------------------------------------ requests to a controller


def package(kind: PackageType, payload: bytes = b"") -> bytes:
    """Return a package's bytes.

    Raises:
        ValueError: If it is too long.
    """
    length = HEADER.size + len(payload)
    if length > LONGEST_PACKAGE_BYTES:
        raise ValueError(f"a package of {length} bytes is longer than {LONGEST_PACKAGE_BYTES}")
    return HEADER.pack(length, kind) + payload


def request_protocol_version(version: int) -> bytes:
    """Return the request to use a protocol version."""
    return package(PackageType.PROTOCOL_VERSION, version.to_bytes(2, "big"))


def request_controller_version() -> bytes:
    """Return the request for the version of the controller's software."""
    return package(PackageType.URCONTROL_VERSION)


def set_up_outputs(names: Sequence[str], frequency_hz: float | None) -> bytes:
    """Return the request to set up outputs.

    Args:
        frequency_hz: Packages a second; None with version 1, whose packages come with every control cycle.

    Raises:
        ValueError: If the names take more than 2,048 bytes.
    """
    rate = b"" if frequency_hz is None else _FREQUENCY.pack(frequency_hz)
    return package(PackageType.SET_UP_OUTPUTS, rate + _names(names))


def set_up_inputs(names: Sequence[str]) -> bytes:
    """Return the request to set up inputs.

    Raises:
        ValueError: If the names take more than 2,048 bytes.
    """
    return package(PackageType.SET_UP_INPUTS, _names(names))


def start() -> bytes:
    """Return the request to start the data packages."""
    return package(PackageType.START)


def pause() -> bytes:
    """Return the request to pause the data packages."""
    return package(PackageType.PAUSE)


def _names(names: Sequence[str]) -> bytes:
    data = ",".join(names).encode("ascii")
    if len(data) > LONGEST_NAMES_BYTES:
        raise ValueError(f"the names of {len(names)} fields take {len(data)} bytes, 2048 are permitted")
    return data
