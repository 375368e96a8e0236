"""Description of a cell: the arms that can collide, and the fixtures and the floor around them.

A description can be pickled for another process. This module imports nothing heavier than NumPy, so a process
that only forwards it needs no kinematics.
"""

from dataclasses import dataclass

from robots.kinematics.joints import FloatArray
from robots.kinematics.kinematic_tree import Shape
from robots.schema.robot_toml import Model
from robots.shapes.geometry import Color

# Default clearances between an arm and the fixtures and other robots of its cell.
WARNING_M = 0.05
STOP_M = 0.01
# Name of the floor in a pair of colliding bodies. It has a blank, so no fixture can have this name.
FLOOR = "the floor"


@dataclass(frozen=True, eq=False)
class Fixture:
    """An object in a cell that does not move.

    Attributes:
        shapes: In the fixture's frame [m].
        fixture_to_site: (4, 4) [m].
        color: None keeps the shapes' colours.
        exact: Check the shapes, not a hull of each piece: slower, but an arm can reach into the fixture.
        ignore: Links that may touch the fixture, as "<robot>/<link>".
    """

    name: str
    shapes: tuple[Shape, ...]
    fixture_to_site: FloatArray
    color: Color | None = None
    exact: bool = False
    ignore: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class CellRobot:
    """An arm of a cell.

    Attributes:
        model: Source for `robots.descriptions.description.load`.
        base_to_site: (4, 4) [m].
        confined: Read no file outside the robot's folder.
        warning_m, stop_m: Clearances to the fixtures and other robots.
    """

    name: str
    model: Model
    base_to_site: FloatArray
    confined: bool = False
    warning_m: float = WARNING_M
    stop_m: float = STOP_M


@dataclass(frozen=True)
class Floor:
    """The half-space below a height. Links that are fixed to a robot's base may reach into it.

    Attributes:
        height_m: In the site's frame; None: the height of the lowest base in the cell.
        warning_m, stop_m: Clearances to the floor. Without a warning distance, only motion checks consider
            the floor, and only contact counts.
    """

    height_m: float | None = None
    warning_m: float = 0.0
    stop_m: float = 0.0


@dataclass(frozen=True, eq=False)
class CellDescription:
    """The robots, fixtures and floor of a cell; it can be pickled.

    Attributes:
        floor: None if the cell has no floor.
    """

    robots: tuple[CellRobot, ...]
    fixtures: tuple[Fixture, ...] = ()
    floor: Floor | None = Floor()

    @property
    def floor_m(self) -> float | None:
        """Height of the floor in the site's frame; None without a floor."""
        if self.floor is None:
            return None
        if self.floor.height_m is not None:
            return self.floor.height_m
        return min((float(robot.base_to_site[2, 3]) for robot in self.robots), default=0.0)
