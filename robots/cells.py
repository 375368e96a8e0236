"""A cell in words and files: arms that can meet, and what stands around them. It can go to another process.

Nothing heavier than NumPy is imported: who only passes it on needs no kinematics.
"""

from dataclasses import dataclass
from pathlib import Path

from robots.joints import FloatArray
from robots.kinematic_tree import Shape
from robots.meshes.mesh import Color

# How near an arm may come to what stands around it, unless a site says otherwise.
WARNING_M = 0.05
STOP_M = 0.01
# The floor in a pair of two that touch; for its blank no fixture has that name.
FLOOR = "the floor"


@dataclass(frozen=True, eq=False)
class Fixture:
    """Something that stands in a cell and does not move.

    Attributes:
        shapes: In its own frame [m].
        fixture_to_site: (4, 4) [m].
        color: None: its shapes' own.
        exact: Checked as its meshes, not as a hull about each piece: slower, and lets an arm reach into it.
        ignore: Links that may touch it, as "<robot>/<link>".
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
        model: As `robots.description.load` takes it.
        base_to_site: (4, 4) [m].
        confined: Nothing outside its own folder is read for it.
        warning_m, stop_m: Distances to what stands around it.
    """

    name: str
    model: str | Path
    base_to_site: FloatArray
    confined: bool = False
    warning_m: float = WARNING_M
    stop_m: float = STOP_M


@dataclass(frozen=True)
class Floor:
    """All that is below a height; what is fixed to the base of a robot may reach into it.

    Attributes:
        height_m: In the site's frame; None: the height of the lowest base in the cell.
        warning_m, stop_m: Distances to it. Without a warning distance only contact counts, only in checks.
    """

    height_m: float | None = None
    warning_m: float = 0.0
    stop_m: float = 0.0


@dataclass(frozen=True, eq=False)
class CellDescription:
    """What a cell is made of; it can be pickled.

    Attributes:
        floor: None: the cell has none.
    """

    robots: tuple[CellRobot, ...]
    fixtures: tuple[Fixture, ...] = ()
    floor: Floor | None = Floor()

    @property
    def floor_m(self) -> float | None:
        """Height of the floor in the site's frame; None: there is none."""
        if self.floor is None:
            return None
        if self.floor.height_m is not None:
            return self.floor.height_m
        return min((float(robot.base_to_site[2, 3]) for robot in self.robots), default=0.0)
