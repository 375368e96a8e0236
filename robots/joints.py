"""A robot's joints in SI: limits, speeds, coupled limits. No kinematics, so nothing heavy is imported."""

from dataclasses import dataclass
from math import degrees, isfinite, radians

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robots.errors import JointCountError
from robots.schema import Joint, JointType, RobotDescription, Units

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
    "position_factor",
    "violations",
]

FloatArray = NDArray[np.float64]

# A controller at its limit reports it rounded to 0.01 degrees or millimetres: that is not a violation.
_ROUNDING_RAD = radians(0.005)
_ROUNDING_M = 0.005e-3


@dataclass(frozen=True, eq=False)
class Constraint:
    """A coupled limit: lower <= coefficients . positions <= upper.

    Attributes:
        names: Joints that take part.
        coefficients: (n,) one a joint of the robot, zero for those that do not.
        lower: [rad] or [m].
        upper: [rad] or [m].
        type: Of the joints that take part; they are all of one.
    """

    names: tuple[str, ...]
    coefficients: FloatArray
    lower: float
    upper: float
    type: JointType


@dataclass(frozen=True, eq=False)
class Joints:
    """The joints of a robot, from the base to the tool; each array is (n,) in rad or m (and seconds)."""

    names: tuple[str, ...]
    types: tuple[JointType, ...]
    lower: FloatArray
    upper: FloatArray
    max_speed: FloatArray
    max_acceleration: FloatArray
    max_jerk: FloatArray
    home: FloatArray
    constraints: tuple[Constraint, ...] = ()

    def __len__(self) -> int:
        return len(self.names)


def joints_of(description: RobotDescription) -> Joints:
    """The joints of a description, in SI."""
    rows = description.joints
    factors = np.array([position_factor(joint, description.units) for joint in rows])

    def column(values: list[float]) -> FloatArray:
        array: FloatArray = np.array(values, dtype=np.float64) * factors
        array.flags.writeable = False
        return array

    return Joints(
        names=tuple(joint.name for joint in rows),
        types=tuple(joint.type for joint in rows),
        lower=column([joint.limits[0] for joint in rows]),
        upper=column([joint.limits[1] for joint in rows]),
        max_speed=column([joint.max_speed for joint in rows]),
        max_acceleration=column([joint.max_acceleration for joint in rows]),
        max_jerk=column([joint.max_jerk for joint in rows]),
        home=column([joint.home for joint in rows]),
        constraints=_constraints_of(description),
    )


def _constraints_of(description: RobotDescription) -> tuple[Constraint, ...]:
    by_name = {joint.name: joint for joint in description.joints}
    constraints = []
    for row in description.constraints:
        members = [by_name[name] for name in row.joints]
        factor = position_factor(members[0], description.units)
        constraints.append(
            Constraint(
                names=tuple(row.joints),
                coefficients=np.array([row.joints.get(joint.name, 0.0) for joint in description.joints]),
                lower=row.limits[0] * factor,
                upper=row.limits[1] * factor,
                type=members[0].type,
            )
        )
    return tuple(constraints)


def length_factor(units: Units) -> float:
    """Metres in the file's unit of length."""
    return 0.001 if units.length == "mm" else 1.0


def angle_factor(units: Units) -> float:
    """Radians in the file's unit of angle."""
    return radians(1.0) if units.angle == "deg" else 1.0


def position_factor(joint: Joint, units: Units) -> float:
    """Radians or metres in the unit of a joint's position."""
    return angle_factor(units) if joint.type is JointType.ROTARY else length_factor(units)


def as_positions(joints: Joints, positions: ArrayLike) -> FloatArray:
    """The positions as (n,) float64 [rad] or [m].

    Raises:
        JointCountError: If there is not one value a joint.
    """
    array = np.asarray(positions, dtype=np.float64)
    if array.shape != (len(joints),):
        raise JointCountError(len(joints), array.shape)
    return array


def constraint_values(joints: Joints, positions: ArrayLike) -> FloatArray:
    """The sum that each constraint limits: (number of constraints,) [rad] or [m]."""
    array = as_positions(joints, positions)
    return np.array([constraint.coefficients @ array for constraint in joints.constraints], dtype=np.float64)


def violations(joints: Joints, positions: ArrayLike) -> tuple[str, ...]:
    """What forbids these positions: a sentence each, in degrees and millimetres; none: allowed.

    Args:
        positions: (n,) joint positions [rad] or [m].

    Raises:
        JointCountError: If there is not one value a joint.
    """
    array = as_positions(joints, positions)
    found = []
    rows = zip(joints.names, joints.types, array.tolist(), joints.lower, joints.upper, strict=True)
    for name, kind, position, lower, upper in rows:
        if not isfinite(position):
            found.append(f"joint {name} at {position} is not a finite number")
            continue
        beyond = _limit_beyond(position, float(lower), float(upper), kind)
        if beyond is not None:
            found.append(f"joint {name} at {_text(position, kind)} is beyond its limit {_text(beyond, kind)}")
    if found:
        return tuple(found)
    for constraint, total in zip(joints.constraints, constraint_values(joints, array), strict=True):
        kind = constraint.type
        beyond = _limit_beyond(float(total), constraint.lower, constraint.upper, kind)
        if beyond is not None:
            terms = _terms(joints, constraint)
            found.append(f"{terms} at {_text(float(total), kind)} is beyond its limit {_text(beyond, kind)}")
    return tuple(found)


def _limit_beyond(position: float, lower: float, upper: float, kind: JointType) -> float | None:
    rounding = _ROUNDING_RAD if kind is JointType.ROTARY else _ROUNDING_M
    if position < lower - rounding:
        return lower
    return upper if position > upper + rounding else None


def _text(position: float, kind: JointType) -> str:
    return f"{degrees(position):.2f}°" if kind is JointType.ROTARY else f"{position * 1000:.2f} mm"


def _terms(joints: Joints, constraint: Constraint) -> str:
    coefficients = dict(zip(joints.names, constraint.coefficients.tolist(), strict=True))
    terms = []
    for name in constraint.names:
        factor = coefficients[name]
        size = "" if abs(factor) == 1 else f"{abs(factor):g} x "
        terms.append(f"{'-' if factor < 0 else '+'} {size}{name}")
    return " ".join(terms).removeprefix("+ ")
