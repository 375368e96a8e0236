"""The units of a description file in SI. Nothing heavy is imported."""

from math import radians

from robots.schema import JointType, Units


def length_factor(units: Units) -> float:
    """Metres in the file's unit of length."""
    return 0.001 if units.length == "mm" else 1.0


def angle_factor(units: Units) -> float:
    """Radians in the file's unit of angle."""
    return radians(1.0) if units.angle == "deg" else 1.0


def position_factor(kind: JointType, units: Units) -> float:
    """Radians or metres in the unit of the position of a joint of that kind."""
    return angle_factor(units) if kind is JointType.ROTARY else length_factor(units)
