"""The protocol's units: degrees and millimetres."""

import math
from collections.abc import Sequence

from robots.joints import JointType


def si_scales(joint_types: Sequence[JointType]) -> tuple[float, ...]:
    """SI over the protocol's unit, one a joint: rad per degree, m per millimetre."""
    return tuple(0.001 if each is JointType.PRISMATIC else math.pi / 180.0 for each in joint_types)
