"""Conversion of the protocol's degrees and millimetres to SI."""

import math
from collections.abc import Sequence

from robots.kinematics.joints import JointType


def si_scales(joint_types: Sequence[JointType]) -> tuple[float, ...]:
    """Return each joint's factor from the protocol's unit to SI: rad per degree, m per millimetre."""
    return tuple(0.001 if each is JointType.PRISMATIC else math.pi / 180.0 for each in joint_types)
