"""What the service asks its worker processes; requests go as their bytes, for messages cannot be pickled."""

from collections.abc import Mapping
from dataclasses import dataclass

from robots.joints import FloatArray


@dataclass(frozen=True, eq=False)
class InverseQuestion:
    """Joint positions of which robot, for which pose."""

    robot: str
    request: bytes


@dataclass(frozen=True, eq=False)
class CheckQuestion:
    """How a program goes.

    Attributes:
        start: (n,) where the robot begins [rad] or [m].
        others: (n,) where each other robot of its cell stands.
    """

    robot: str
    request: bytes
    start: FloatArray
    others: Mapping[str, FloatArray]


Question = InverseQuestion | CheckQuestion
