"""Factors from a description file's units to SI. Imports nothing heavy."""

from math import radians

from robots.schema.robot_toml import JointType, Units


def length_factor(units: Units) -> float:
    """Return the metres in one length unit of the file."""
    return 0.001 if units.length == "mm" else 1.0


def angle_factor(units: Units) -> float:
    """Return the radians in one angle unit of the file."""
    return radians(1.0) if units.angle == "deg" else 1.0


def position_factor(kind: JointType, units: Units) -> float:
    """Return the radians or metres in one position unit of a joint of this type."""
    return angle_factor(units) if kind is JointType.ROTARY else length_factor(units)
