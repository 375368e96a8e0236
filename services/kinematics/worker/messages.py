"""Questions to the worker processes; requests are serialized because messages cannot be pickled."""

from collections.abc import Mapping
from dataclasses import dataclass

from robots.descriptions.cells import CellDescription
from robots.kinematics.joints import FloatArray


@dataclass(frozen=True, eq=False)
class InverseQuestion:
    """An inverse-kinematics request about a robot."""

    robot: str
    request: bytes


@dataclass(frozen=True, eq=False)
class CheckQuestion:
    """A program-check request about a robot.

    Attributes:
        start: (n,) start positions of the robot [rad] or [m].
        others: (n,) positions of each other robot of its cell.
    """

    robot: str
    request: bytes
    start: FloatArray
    others: Mapping[str, FloatArray]


@dataclass(frozen=True, eq=False)
class ReplaceCells:
    """A request to answer from other cells from now on; the answer is empty.

    Attributes:
        cells: By robot.
    """

    cells: Mapping[str, CellDescription]


Question = InverseQuestion | CheckQuestion | ReplaceCells
