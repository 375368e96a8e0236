"""Joint positions from axes that a server reports separately, each with its own time.

OPC UA, part 4: a server samples each variable at an interval, and reports the changed ones. A variable that a
notification does not contain has its old value. The changed ones may be of different moments, so they are
joined only if their SourceTimestamps differ by at most one sampling interval. Otherwise the positions are
unknown until the next notification.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from controllers.opcua.facts import POSITION, SPEED, Item, ItemsFound, Reading, order_of
from controllers.opcua.settings import OpcUaJoint
from controllers.opcua.units import BY_NUMBER, Unit, number_of, scale_of
from protocol_gateway.seam.errors import GatewaySettingsError
from robots.kinematics.joints import JointType

_UNITS = {"deg": "DD", "rad": "C81", "mm": "MMT", "m": "MTR"}
_LINEAR_PROFILES, _ROTARY_PROFILES = (3, 4), (1, 2)
LEAST_SPREAD_S = 0.01
"""Times of one moment may differ by this much at any rate: software timers are not better."""


class NotShownError(ValueError):
    """The server's axes do not give the joints; the text says why, and what to do."""


@dataclass(frozen=True, slots=True)
class Axis:
    """Axis of a joint.

    Attributes:
        position: Number of the item with its position.
        speed: Number of the item with its speed; None: not reported.
        factor: SI units a unit of the server, negative where the joint turns the other way.
        zero: Position of the joint [rad] or [m] at 0.
        speed_factor: Of the speed; None: its unit is unknown.
    """

    name: str
    position: int
    speed: int | None
    factor: float
    zero: float
    speed_factor: float | None


def check_declared(joints: Sequence[OpcUaJoint], joint_types: Sequence[JointType]) -> None:
    """Check the site file's joints.

    Raises:
        GatewaySettingsError: If they do not fit the model.
    """
    if joints and len(joints) != len(joint_types):
        raise GatewaySettingsError(
            f"opcua joints: {len(joints)} are declared, but the model has {len(joint_types)} joints"
        )
    for number, (joint, joint_type) in enumerate(zip(joints, joint_types, strict=False), 1):
        if bool(joint.axis) is bool(joint.node):
            raise GatewaySettingsError(f"opcua joint {number}: must have either axis or node")
        if joint.unit:
            scale = BY_NUMBER[number_of(_UNITS[joint.unit])]
            if scale.linear is not (joint_type is JointType.PRISMATIC):
                raise GatewaySettingsError(
                    f"opcua joint {number}: unit {joint.unit!r} does not fit the model's joint"
                )


def axes_of(
    found: ItemsFound, declared: Sequence[OpcUaJoint], joint_types: Sequence[JointType]
) -> tuple[Axis, ...]:
    """Return the axis of each joint.

    Raises:
        NotShownError: If one is missing, has no unit, or does not fit the model.
    """
    positions = {item.name: number for number, item in enumerate(found.items) if item.kind == POSITION}
    speeds = {item.name: number for number, item in enumerate(found.items) if item.kind == SPEED}
    joints = declared or [OpcUaJoint(axis=name) for name in _in_order(list(positions))]
    if len(joints) != len(joint_types):
        raise NotShownError(
            f"the server has {len(joints)} axes ({', '.join(positions) or 'none'}), but the model has "
            f"{len(joint_types)} joints: name the axis of each joint in [robot.opcua] joints"
        )
    axes: list[Axis] = []
    for joint, joint_type in zip(joints, joint_types, strict=True):
        name = joint.axis or joint.node
        if name not in positions:
            raise NotShownError(
                f"the server has no position of {name}; it has {', '.join(positions) or 'none'}"
            )
        item = found.items[positions[name]]
        factor = _factor(item, joint.unit, joint_type)
        sign = -1.0 if joint.reversed else 1.0
        speed = speeds.get(name)
        speed_scale = None if speed is None else scale_of(found.items[speed].unit)
        linear = joint_type is JointType.PRISMATIC
        known = speed_scale is not None and speed_scale.linear is linear
        axes.append(
            Axis(
                name=name,
                position=positions[name],
                speed=speed,
                factor=sign * factor,
                zero=joint.zero * (1e-3 if linear else math.radians(1.0)),
                speed_factor=sign * speed_scale.factor if speed_scale is not None and known else None,
            )
        )
    return tuple(axes)


def _in_order(names: list[str]) -> list[str]:
    return [names[each] for each in order_of(names)]


def _factor(item: Item, declared: str, joint_type: JointType) -> float:
    unit = Unit(number_of(_UNITS[declared])) if declared else item.unit
    scale = scale_of(unit)
    if scale is None or scale.linear is None:
        says = f"the unit {unit.text!r} ({unit.number})" if unit else "no unit (EngineeringUnits)"
        raise NotShownError(
            f"{item.name} has {says}: declare unit as deg, rad, mm or m of each joint in [robot.opcua] joints"
        )
    linear = joint_type is JointType.PRISMATIC
    if scale.linear is not linear:
        raise NotShownError(
            f"{item.name} is in {scale.unit}, but this joint of the model is {joint_type.value}: "
            "declare the axes in the model's order in [robot.opcua] joints"
        )
    if item.profile in (_ROTARY_PROFILES if linear else _LINEAR_PROFILES):
        raise NotShownError(
            f"{item.name} moves on a {'rotary' if linear else 'linear'} axis (MotionProfile {item.profile}), "
            f"but this joint of the model is {joint_type.value}"
        )
    return scale.factor


@dataclass(frozen=True, slots=True)
class Joined:
    """Joints of one moment.

    Attributes:
        positions: One a joint [rad] or [m].
        velocities: One a joint [rad/s] or [m/s]; None: not reported.
        source_s: Newest SourceTimestamp of what has changed; None: nothing has changed, or not reported.
        spread_s: Difference of the times of what has changed.
    """

    positions: tuple[float, ...]
    velocities: tuple[float, ...] | None
    source_s: float | None
    spread_s: float


class Joiner:
    """Values of all axes, and which of them are of one moment.

    Args:
        axes: One a joint.
        limit_s: Greatest difference of SourceTimestamps that counts as one moment.
    """

    def __init__(self, axes: Sequence[Axis], limit_s: float) -> None:
        self._axes = axes
        self._limit_s = limit_s
        self._items = {each.position for each in axes}
        self._speeds = {each.speed for each in axes if each.speed is not None}
        self._known: dict[int, Reading] = {}

    def take(self, readings: Sequence[Reading]) -> Joined | str:
        """Take a notification; return the joints, or why they are unknown."""
        changed: dict[int, float] = {}
        for each in readings:
            if each.item not in self._items and each.item not in self._speeds:
                continue
            before = self._known.get(each.item)
            if each.source_s is not None and (before is None or before.value != each.value):
                changed[each.item] = each.source_s
            self._known[each.item] = each
        positions: list[float] = []
        for axis in self._axes:
            value = self._number(axis.position)
            if value is None:
                return f"{axis.name} has no good value"
            positions.append(value * axis.factor + axis.zero)
        times_s = [changed[each] for each in self._items if each in changed]
        spread_s = max(times_s) - min(times_s) if times_s else 0.0
        if spread_s > self._limit_s:
            return (
                f"the axes' times differ by {spread_s:.3g} s; up to {self._limit_s:.3g} s they are one moment"
            )
        newest_s = max(times_s, default=None)
        return Joined(tuple(positions), self._velocities(changed, times_s), newest_s, spread_s)

    def _velocities(self, changed: dict[int, float], times_s: Sequence[float]) -> tuple[float, ...] | None:
        """Return the velocities, if they are of the positions' moment."""
        found: list[float] = []
        for axis in self._axes:
            value = None if axis.speed is None else self._number(axis.speed)
            if value is None or axis.speed_factor is None or axis.speed is None:
                return None
            if axis.speed in changed and times_s:
                at_s = changed[axis.speed]
                if max(at_s, *times_s) - min(at_s, *times_s) > self._limit_s:
                    return None
            found.append(value * axis.speed_factor)
        return tuple(found)

    def _number(self, item: int) -> float | None:
        reading = self._known.get(item)
        if reading is None or not reading.good or isinstance(reading.value, bool | str):
            return None
        return reading.value
