"""A robot's joints in SI: limits, speeds, coupled limits. Has no kinematics and imports nothing heavy."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import degrees, isfinite, radians

import numpy as np
from numpy.typing import ArrayLike

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.kinematics.kinematic_tree import Doubt, tree_of
from robots.schema.errors import JointCountError
from robots.schema.poses import FloatArray
from robots.schema.robot_toml import (
    DhDescription,
    JointSettings,
    JointType,
    RobotDescription,
    UrdfDescription,
)
from robots.schema.units import angle_factor, length_factor, position_factor

__all__ = [
    "Constraint",
    "FloatArray",
    "JointType",
    "Joints",
    "angle_factor",
    "as_positions",
    "constraint_values",
    "joints_of",
    "length_factor",
    "position_text",
    "violations",
]

# Defaults for a URDF, from the library's robots: 0.25 s to full speed.
ACCELERATION_PER_SPEED = 4.0
JERK_PER_ACCELERATION = 10.0

# A controller at its limit reports it rounded to 0.01 degrees or millimetres: that is not a violation.
_ROUNDING_RAD = radians(0.005)
_ROUNDING_M = 0.005e-3


@dataclass(frozen=True, eq=False)
class Constraint:
    """A coupled limit: lower <= coefficients . positions <= upper.

    Attributes:
        names: Joints in the sum.
        coefficients: (n,) one per joint of the robot, zero for joints that are not in the sum.
        lower: [rad] or [m].
        upper: [rad] or [m].
        type: The type that all joints in the sum have.
    """

    names: tuple[str, ...]
    coefficients: FloatArray
    lower: float
    upper: float
    type: JointType


@dataclass(frozen=True, eq=False)
class Joints:
    """The joints of a robot, from the base to the tool; each array is (n,) in rad or m (and seconds).

    Attributes:
        continuous: The source gives no limits: lower and upper are defaults.
        doubts: Doubts about the source that the description does not settle, by joint and key.
    """

    names: tuple[str, ...]
    types: tuple[JointType, ...]
    lower: FloatArray
    upper: FloatArray
    max_speed: FloatArray
    max_acceleration: FloatArray
    max_jerk: FloatArray
    home: FloatArray
    continuous: tuple[bool, ...]
    constraints: tuple[Constraint, ...] = ()
    doubts: Mapping[str, Mapping[str, Doubt]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.names)


def joints_of(description: RobotDescription) -> Joints:
    """Return the joints of a description, in SI."""
    if isinstance(description, UrdfDescription):
        joints = _urdf_joints(description)
    else:
        assert isinstance(description, DhDescription)
        joints = _row_joints(description)
    return replace(joints, constraints=_constraints_of(description, joints))


def doubt_texts(joints: Joints) -> dict[str, str]:
    """Return by joint what is doubtful about its limits."""
    return {name: "; ".join(each.text for each in found.values()) for name, found in joints.doubts.items()}


def doubt_notes(description: RobotDescription) -> tuple[str, ...]:
    """Return a sentence for each joint whose limits are doubtful, with what to do."""
    return tuple(
        f'joint {name!r}: {text}. check = "require" refuses motion until the URDF is right, or robot.toml or '
        "the site file states its limits and max_speed"
        for name, text in doubt_texts(joints_of(description)).items()
    )


def doubtful_limits(robot: str, joints: Joints) -> Reason | None:
    """Return the reason why limits of a robot are doubtful; None if none are."""
    if not joints.doubts:
        return None
    (*names,) = joints.doubts
    listed = ", ".join(names[:8]) + (f", ... ({len(names)})" if len(names) > 8 else "")
    return codes.LIMITS_DOUBTFUL(
        name=robot, joints=listed, detail=f"{names[0]}: {doubt_texts(joints)[names[0]]}"
    )


def _row_joints(description: DhDescription) -> Joints:
    rows = description.joints
    factors = np.array([position_factor(joint.type, description.units) for joint in rows])

    def column(values: list[float]) -> FloatArray:
        return _readonly(np.array(values, dtype=np.float64) * factors)

    return Joints(
        names=tuple(joint.name for joint in rows),
        types=tuple(joint.type for joint in rows),
        lower=column([joint.limits[0] for joint in rows]),
        upper=column([joint.limits[1] for joint in rows]),
        max_speed=column([joint.max_speed for joint in rows]),
        max_acceleration=column([joint.max_acceleration for joint in rows]),
        max_jerk=column([joint.max_jerk for joint in rows]),
        home=column([joint.home for joint in rows]),
        continuous=(False,) * len(rows),
    )


def _urdf_joints(description: UrdfDescription) -> Joints:
    """Return the URDF's joints, with the description's settings in place of the URDF's values."""
    tree = tree_of(description)
    settings = {row.name: row for row in description.joints}
    columns, doubts = [], {}
    free = [tree.joints[number] for number in tree.free]
    for joint in free:
        given = settings.get(joint.name) or JointSettings(name=joint.name)
        factor = position_factor(joint.type, description.units)

        def value(number: float | None, otherwise: float, factor: float = factor) -> float:
            return otherwise if number is None else number * factor

        lower = value(given.limits[0] if given.limits else None, joint.lower)
        upper = value(given.limits[1] if given.limits else None, joint.upper)
        speed = value(given.max_speed, joint.max_speed)
        acceleration = value(given.max_acceleration, ACCELERATION_PER_SPEED * speed)
        jerk = value(given.max_jerk, JERK_PER_ACCELERATION * acceleration)
        home = value(given.home, 0.0 if lower <= 0.0 <= upper else (lower + upper) / 2)
        columns.append((lower, upper, speed, acceleration, jerk, home))
        if found := {key: each for key, each in joint.doubts.items() if getattr(given, key) is None}:
            doubts[joint.name] = found
    lower_, upper_, speeds, accelerations, jerks, homes = map(_readonly, np.array(columns).T)
    return Joints(
        names=tuple(joint.name for joint in free),
        types=tuple(joint.type for joint in free),
        lower=lower_,
        upper=upper_,
        max_speed=speeds,
        max_acceleration=accelerations,
        max_jerk=jerks,
        home=homes,
        continuous=tuple(joint.continuous and not _has_limits(settings.get(joint.name)) for joint in free),
        doubts=doubts,
    )


def _has_limits(given: JointSettings | None) -> bool:
    return given is not None and given.limits is not None


def _readonly(array: FloatArray) -> FloatArray:
    array = np.ascontiguousarray(array)
    array.flags.writeable = False
    return array


def _constraints_of(description: RobotDescription, joints: Joints) -> tuple[Constraint, ...]:
    types = dict(zip(joints.names, joints.types, strict=True))
    constraints = []
    for row in description.constraints:
        kind = types[next(iter(row.joints))]
        factor = position_factor(kind, description.units)
        constraints.append(
            Constraint(
                names=tuple(row.joints),
                coefficients=np.array([row.joints.get(name, 0.0) for name in joints.names]),
                lower=row.limits[0] * factor,
                upper=row.limits[1] * factor,
                type=kind,
            )
        )
    return tuple(constraints)


def as_positions(joints: Joints, positions: ArrayLike) -> FloatArray:
    """Return the positions as (n,) float64 [rad] or [m].

    Raises:
        JointCountError: If there is not one value per joint.
    """
    array = np.asarray(positions, dtype=np.float64)
    if array.shape != (len(joints),):
        raise JointCountError(codes.JOINT_SHAPE(shape=array.shape, joints=len(joints)))
    return array


def constraint_values(joints: Joints, positions: ArrayLike) -> FloatArray:
    """Return the sum that each constraint limits: (number of constraints,) [rad] or [m]."""
    array = as_positions(joints, positions)
    return np.array([constraint.coefficients @ array for constraint in joints.constraints], dtype=np.float64)


def violations(joints: Joints, positions: ArrayLike) -> tuple[Reason, ...]:
    """Return the limits that these positions violate, in degrees and millimetres; empty if allowed.

    Args:
        positions: (n,) joint positions [rad] or [m].

    Raises:
        JointCountError: If there is not one value per joint.
    """
    array = as_positions(joints, positions)
    found = []
    rows = zip(joints.names, joints.types, array.tolist(), joints.lower, joints.upper, strict=True)
    for name, kind, position, lower, upper in rows:
        if not isfinite(position):
            found.append(codes.JOINT_NOT_FINITE(name=name, value=position))
            continue
        beyond = _limit_beyond(position, float(lower), float(upper), kind)
        if beyond is not None:
            value, limit = position_text(position, kind), position_text(beyond, kind)
            found.append(codes.JOINT_LIMIT(name=name, value=value, limit=limit))
    if found:
        return tuple(found)
    for constraint, total in zip(joints.constraints, constraint_values(joints, array), strict=True):
        kind = constraint.type
        beyond = _limit_beyond(float(total), constraint.lower, constraint.upper, kind)
        if beyond is not None:
            terms = _terms(joints, constraint)
            found.append(
                codes.JOINT_CONSTRAINT(
                    terms=terms, value=position_text(float(total), kind), limit=position_text(beyond, kind)
                )
            )
    return tuple(found)


def _limit_beyond(position: float, lower: float, upper: float, kind: JointType) -> float | None:
    rounding = _ROUNDING_RAD if kind is JointType.ROTARY else _ROUNDING_M
    if position < lower - rounding:
        return lower
    return upper if position > upper + rounding else None


def position_text(position: float, kind: JointType) -> str:
    """Return a position [rad] or [m] in degrees or millimetres, as texts name it."""
    # Decimals mean nothing in a number this large, and its degrees may overflow.
    if abs(position) >= 1e6:
        return f"{position:.3g} {'rad' if kind is JointType.ROTARY else 'm'}"
    return f"{degrees(position):.2f}°" if kind is JointType.ROTARY else f"{position * 1000:.2f} mm"


def _terms(joints: Joints, constraint: Constraint) -> str:
    coefficients = dict(zip(joints.names, constraint.coefficients.tolist(), strict=True))
    terms = []
    for name in constraint.names:
        factor = coefficients[name]
        size = "" if abs(factor) == 1 else f"{abs(factor):g} x "
        terms.append(f"{'-' if factor < 0 else '+'} {size}{name}")
    return " ".join(terms).removeprefix("+ ")
