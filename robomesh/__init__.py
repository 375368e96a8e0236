"""Robots on the network: read their states, control them, and open their recordings.

import robomesh

with robomesh.connect() as mesh:
    for state in mesh.robot("pt600").joints():
        print(state.time, state.positions_deg)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from robomesh.client.blocking import Arm, Mesh, Recording, Robot, open_recording
    from robomesh.client.mesh import AsyncMesh, RobotNotFoundError, Service
    from robomesh.client.recordings.arrays import RecordedJoints, RecordedValues
    from robomesh.client.recordings.descriptions import RecordedTopic, RecordingInfo
    from robomesh.client.recordings.recording import AsyncRecording, RecordedSample
    from robomesh.client.robot.commands import CommandResult, JogResult, StopResult
    from robomesh.client.robot.control import AsyncArm
    from robomesh.client.robot.notes import Note
    from robomesh.client.robot.robot import AsyncRobot, CheckResult, InverseResult, Violation
    from robomesh.client.robot.samples import Alarm, Event, JointState, Sample, SignalState
    from robomesh.client.robot.streams import AsyncStream, StaleError, Stream
    from robomesh.errors import (
        BusyError,
        KeyNameError,
        MessageError,
        MotionError,
        NoAnswerError,
        QuotaError,
        RefusedError,
        RobomeshError,
        SessionError,
        UnknownTopicError,
    )
    from robomesh.recordings.errors import RecordingError

    connect = Mesh
    connect_async = AsyncMesh

# Imported when they are used: the services import parts of this package, and need no client.
_MODULES = {
    "client.blocking": ("Arm", "Mesh", "Recording", "Robot", "open_recording"),
    "client.robot.commands": ("CommandResult", "JogResult", "StopResult"),
    "client.robot.control": ("AsyncArm",),
    "client.mesh": ("AsyncMesh", "RobotNotFoundError", "Service"),
    "client.robot.notes": ("Note",),
    "client.recordings.arrays": ("RecordedJoints", "RecordedValues"),
    "client.recordings.recording": ("AsyncRecording", "RecordedSample"),
    "client.recordings.descriptions": ("RecordedTopic", "RecordingInfo"),
    "client.robot.robot": ("AsyncRobot", "CheckResult", "InverseResult", "Violation"),
    "client.robot.samples": ("Alarm", "Event", "JointState", "Sample", "SignalState"),
    "client.robot.streams": ("AsyncStream", "StaleError", "Stream"),
    "errors": (
        "RobomeshError",
        "BusyError",
        "KeyNameError",
        "MessageError",
        "MotionError",
        "NoAnswerError",
        "QuotaError",
        "RefusedError",
        "SessionError",
        "UnknownTopicError",
    ),
    "recordings.errors": ("RecordingError",),
}
_PLACES = {name: (module, name) for module, names in _MODULES.items() for name in names}
_PLACES["connect"] = "client.blocking", "Mesh"
_PLACES["connect_async"] = "client.mesh", "AsyncMesh"

__all__ = [
    "Alarm",
    "Arm",
    "AsyncArm",
    "AsyncMesh",
    "AsyncRecording",
    "AsyncRobot",
    "AsyncStream",
    "BusyError",
    "CheckResult",
    "CommandResult",
    "Event",
    "InverseResult",
    "JogResult",
    "JointState",
    "KeyNameError",
    "Mesh",
    "MessageError",
    "MotionError",
    "NoAnswerError",
    "Note",
    "QuotaError",
    "RecordedJoints",
    "RecordedSample",
    "RecordedTopic",
    "RecordedValues",
    "Recording",
    "RecordingError",
    "RecordingInfo",
    "RefusedError",
    "RobomeshError",
    "Robot",
    "RobotNotFoundError",
    "Sample",
    "Service",
    "SessionError",
    "SignalState",
    "StaleError",
    "StopResult",
    "Stream",
    "UnknownTopicError",
    "Violation",
    "connect",
    "connect_async",
    "open_recording",
]


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, place = _PLACES[name]
    value = globals()[name] = getattr(import_module(f"{__name__}.{module}"), place)
    return value


def __dir__() -> list[str]:
    return __all__
