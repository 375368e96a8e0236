"""Numbers in recorded messages by name: "joints/waist/position", "kinematics/tool/x", ...

A name is the topic below its robot, then the fields; repeated messages are identified by their `name` field.
A signal has its own name: "signals/joint.waist.current". Booleans are 0 and 1; texts have no number.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import lru_cache
from math import atan2, hypot
from types import MappingProxyType
from typing import Any

from google.protobuf.descriptor import FieldDescriptor as Field

from robomesh.contract.topics import TOPICS, History
from robomesh.schemas.robomesh_pb2 import Description, Signals

_JOINT_UNITS = {"position": "", "velocity": "/s", "acceleration": "/s²"}
_MARGIN = "kinematics/margin/"
_SIGNALS = "signals/"
_ANGLES = ("roll", "pitch", "yaw")
_VERTICAL = 1e-6  # least horizontal length of a tool's x axis that has a direction
_NUMBERS = frozenset(
    {
        Field.CPPTYPE_DOUBLE,
        Field.CPPTYPE_FLOAT,
        Field.CPPTYPE_INT32,
        Field.CPPTYPE_INT64,
        Field.CPPTYPE_UINT32,
        Field.CPPTYPE_UINT64,
        Field.CPPTYPE_BOOL,
        Field.CPPTYPE_ENUM,
    }
)
_TIMES = frozenset({"google.protobuf.Timestamp", "google.protobuf.Duration"})
# Deeper nesting in other programs' messages is ignored.
_DEEPEST = 6
_NO_NUMBERS = frozenset(
    {
        "foxglove.FrameTransforms",  # 12 numbers for each link at 60 Hz, which the 3-D view shows better
        "foxglove.CompressedVideo",
        "foxglove.CompressedImage",
        "robomesh.Description",
        "robomesh.AuditEntry",
        "robomesh.RawRecord",
    }
)


def has_values(schema: str) -> bool:
    """Return whether messages of a schema have values."""
    return schema not in _NO_NUMBERS


def live_topics() -> dict[str, str]:
    """Return the topics of a robot whose newest messages have values, with their schemas' full names."""
    return {
        name: row.schema.DESCRIPTOR.full_name
        for name, row in TOPICS.items()
        if row.recorded and row.history is History.LAST and has_values(row.schema.DESCRIPTOR.full_name)
    }


def values_of(schema: str, message: Any) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message with their names below its topic."""
    if schema == "foxglove.JointStates":
        for joint in message.joints:
            position, velocity, acceleration, effort = _joint_values(joint.name)
            # Written out: an hour of joint states has millions of numbers.
            if joint.HasField("position"):
                yield position, joint.position
            if joint.HasField("velocity"):
                yield velocity, joint.velocity
            if joint.HasField("acceleration"):
                yield acceleration, joint.acceleration
            if joint.HasField("effort"):
                yield effort, joint.effort
    elif schema == "robomesh.KinematicState":
        yield from _kinematics(message)
    elif schema == "robomesh.Signals":
        for signal in message.signals:
            kind = signal.WhichOneof("value")
            if kind == "number":
                yield signal.name, signal.number
            elif kind == "on":
                yield signal.name, float(signal.on)
    else:
        yield from _fields(message, "", _DEEPEST)


@lru_cache(maxsize=1000)
def _joint_values(joint: str) -> tuple[str, str, str, str]:
    return f"{joint}/position", f"{joint}/velocity", f"{joint}/acceleration", f"{joint}/effort"


def topic_of(name: str, topics: Collection[str]) -> str | None:
    """Return the topic of a value; None: it is not one of these."""
    return max((each for each in topics if name.startswith(f"{each}/")), key=len, default=None)


def prismatic_joints(description: Description | None) -> frozenset[str]:
    """Return the names of the prismatic joints (unit: metre); none without a description."""
    joints = [] if description is None else description.joints
    return frozenset(joint.name for joint in joints if joint.type == Description.Joint.PRISMATIC)


def signal_units(message: Signals) -> dict[str, str]:
    """Return the unit of each signal by the name of its value."""
    return {f"{_SIGNALS}{each.name}": each.unit for each in message.signals}


def unit_of(
    name: str, prismatic: Collection[str] = (), signals: Mapping[str, str] = MappingProxyType({})
) -> str:
    """Return the unit of a value by its name; empty: no unit, or unknown.

    Args:
        prismatic: Names of the robot's prismatic joints.
        signals: Units of its signals, from `signal_units`.
    """
    if name.startswith(_SIGNALS):
        return signals.get(name, "")
    first, *between, last = name.split("/")
    if first == "joints":
        slides = "/".join(between) in prismatic
        if last == "effort":
            return "N" if slides else "N·m"
        return ("m" if slides else "rad") + _JOINT_UNITS[last] if last in _JOINT_UNITS else ""
    if first == "kinematics":
        if name.startswith("kinematics/tool/"):
            return "rad" if last in _ANGLES else "m" if len(last) == 1 else "m/s"
        if name.startswith(_MARGIN):
            return "m" if name.removeprefix(_MARGIN) in prismatic else "rad"
        return "m" if "clearance" in last else ""
    for ending, unit in (("_s", "s"), ("_m", "m"), ("_hz", "Hz"), ("_percent", "%"), ("bytes", "B")):
        if last.endswith(ending):
            return unit
    return ""


def fixed_angles(pose: Sequence[float]) -> tuple[float, float, float]:
    """Return roll, pitch and yaw [rad] about the fixed axes, as in a URDF.

    At a pitch of ±90 degrees roll and yaw are one rotation, returned as roll.

    Args:
        pose: A placement's 16 numbers by rows.
    """
    across = hypot(pose[0], pose[4])
    pitch = atan2(-pose[8], across)
    if across < _VERTICAL:
        return atan2(-pose[6], pose[5]), pitch, 0.0
    return atan2(pose[9], pose[10]), pitch, atan2(pose[4], pose[0])


def _kinematics(message: Any) -> Iterator[tuple[str, float]]:
    pose = message.tool_to_base
    if len(pose) == 16:
        yield "tool/x", pose[3]
        yield "tool/y", pose[7]
        yield "tool/z", pose[11]
        yield from zip((f"tool/{name}" for name in _ANGLES), fixed_angles(pose), strict=True)
    if message.HasField("linear_velocity"):
        v = message.linear_velocity
        yield "tool/speed", (v.x * v.x + v.y * v.y + v.z * v.z) ** 0.5
    for name in ("manipulability", "singularity_margin"):
        if message.HasField(name):
            yield name, getattr(message, name)
    for name in ("clearance", "own_clearance"):
        if message.HasField(name):
            yield name, getattr(message, name).distance
    for margin in message.limit_margins:
        yield f"margin/{margin.name}", min(margin.lower, margin.upper)


def _fields(message: Any, prefix: str, deepest: int) -> Iterator[tuple[str, float]]:
    for field in message.DESCRIPTOR.fields:
        name = prefix + field.name
        if field.cpp_type in _NUMBERS:
            if field.is_repeated:
                for number, value in enumerate(getattr(message, field.name)):
                    yield f"{name}/{number}", float(value)
            elif not field.has_presence or message.HasField(field.name):
                yield name, float(getattr(message, field.name))
        elif field.cpp_type == Field.CPPTYPE_MESSAGE and deepest and _is_plain(field):
            if field.is_repeated:
                for number, child in enumerate(getattr(message, field.name)):
                    own = getattr(child, "name", "") or str(number)
                    yield from _fields(child, f"{name}/{own}/", deepest - 1)
            elif message.HasField(field.name):
                yield from _fields(getattr(message, field.name), f"{name}/", deepest - 1)


def _is_plain(field: Field) -> bool:
    kind = field.message_type
    return kind is not None and kind.full_name not in _TIMES and not kind.GetOptions().map_entry
