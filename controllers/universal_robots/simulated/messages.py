"""Messages that a controller sends: answers by RTDE, and packages of the primary interface."""

import struct

from controllers.universal_robots.interfaces.modes import RuntimeState, SafetyMode, TextLevel
from controllers.universal_robots.interfaces.primary import (
    HEADER,
    ROBOT_MESSAGE,
    Alarm,
    KeyMessage,
    Origin,
    Popup,
    PrimaryMessage,
    PrimaryText,
    PrimaryVersion,
    RuntimeFault,
    SafetyModeChanged,
)
from controllers.universal_robots.interfaces.rtde_messages import (
    ControllerVersion,
    PackageType,
    package,
)
from controllers.universal_robots.simulated.controller import UrController

_ROBOT_STATE = 16
_MODE_DATA = struct.Struct(">IBQ???????BBddd")
_SOURCE = b"URControl"


def accepted(kind: PackageType, yes: bool) -> bytes:
    """Return an answer that accepts or refuses."""
    return package(kind, bytes([yes]))


def version(number: ControllerVersion) -> bytes:
    """Return the answer with the version of the software."""
    return package(
        PackageType.URCONTROL_VERSION,
        struct.pack(">4I", number.major, number.minor, number.bugfix, number.build),
    )


def set_up(kind: PackageType, recipe_id: int | None, types: list[str]) -> bytes:
    """Return the answer to a set-up; without a number for version 1."""
    return package(kind, (b"" if recipe_id is None else bytes([recipe_id])) + ",".join(types).encode())


def text(words: str, level: TextLevel, protocol_version: int) -> bytes:
    """Return a text message of at most 255 bytes."""
    data = words.encode("ascii", "replace")[:255]
    if protocol_version < 2:
        return package(PackageType.TEXT, bytes([level]) + data)
    return package(
        PackageType.TEXT, bytes([len(data)]) + data + bytes([len(_SOURCE)]) + _SOURCE + bytes([level])
    )


def primary_version(number: ControllerVersion) -> PrimaryVersion:
    """Return the first message of the primary interface."""
    return PrimaryVersion(
        Origin(0, -2), _SOURCE.decode(), number.major, number.minor, number.bugfix, number.build, "simulated"
    )


def robot_message(message: PrimaryMessage) -> bytes:
    """Return a robot message as a package of the primary interface."""
    match message:
        case PrimaryVersion():
            kind = 3
            payload = (
                _counted(message.name)
                + struct.pack(">BBii", message.major, message.minor, message.bugfix, message.build)
                + message.date.encode()
            )
        case SafetyModeChanged():
            kind, payload = 5, struct.pack(">iiBII", message.code, message.argument, message.mode, 0, 0)
        case Alarm():
            numbers = message.code, message.argument, message.level, message.data_type, message.data
            kind, payload = 6, struct.pack(">iiiII", *numbers) + message.text.encode()
        case KeyMessage():
            kind = 7
            payload = struct.pack(">ii", message.code, message.argument) + _counted(message.title)
            payload += message.text.encode()
        case PrimaryText():
            kind, payload = 0, message.text.encode()
        case Popup():
            flags = message.warning, message.error, message.blocking
            kind, payload = 2, struct.pack(">II???", 0, 0, *flags) + _counted(message.title)
            payload += message.text.encode()
        case RuntimeFault():
            kind, payload = 10, struct.pack(">ii", message.line, message.column) + message.text.encode()
        case _:
            raise AssertionError(f"the simulated controller does not send {type(message).__name__}")
    origin = struct.pack(">QbB", message.origin.time, message.origin.source, kind)
    return _package(ROBOT_MESSAGE, origin + payload)


def robot_state(controller: UrController, now_s: float) -> bytes:
    """Return a state of the primary interface, with the modes only."""
    stopped = controller.safety_mode is SafetyMode.PROTECTIVE_STOP
    state = controller.runtime_state
    part = _MODE_DATA.pack(
        _MODE_DATA.size,
        0,
        int(controller.uptime_s(now_s) * 1e6),
        True,
        True,
        controller.robot_mode.name == "RUNNING",
        False,
        stopped,
        state is RuntimeState.PLAYING,
        state is RuntimeState.PAUSED,
        int(controller.robot_mode),
        0,
        controller.speed_slider,
        0.0 if stopped else controller.speed_slider,
        1.0,
    )
    return _package(_ROBOT_STATE, part)


def _package(kind: int, payload: bytes) -> bytes:
    return HEADER.pack(HEADER.size + len(payload), kind) + payload


def _counted(words: str) -> bytes:
    data = words.encode()
    return bytes([len(data)]) + data
