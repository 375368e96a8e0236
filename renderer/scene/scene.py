"""Data of a scene, the input of a drawing."""

from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class Finish(Enum):
    """The appearance of a body."""

    PLAIN = auto()
    STALE = auto()  # grey: its placement is out of date
    RED = auto()  # in contact
    GHOST = auto()  # blue and translucent: a target placement


@dataclass(frozen=True, eq=False)
class Part:
    """A body of the scene.

    Attributes:
        shape: Name of its triangles in the drawing.
        part_to_site: (4, 4).
        name: Name of the link or fixture.
    """

    shape: str
    part_to_site: FloatArray
    finish: Finish = Finish.PLAIN
    name: str = ""


@dataclass(frozen=True, eq=False)
class Line:
    """A line through points; bodies in front of it hide it.

    Attributes:
        points: (n, 3) in the site's frame [m].
        color: Red, green, blue, 0 to 1 (sRGB).
        opacity: (n,) at each point, 0 to 1.
        width: Width in a picture 720 px high [px].
    """

    points: FloatArray
    color: tuple[float, float, float]
    opacity: FloatArray
    width: float = 2.0


@dataclass(frozen=True, eq=False)
class Scene:
    """The content of one picture, in the site's frame [m].

    Attributes:
        parts: The robot's bodies, which a close-up shows.
        center: (3,) centre of the sphere around the arm's workspace.
        radius: Radius of that sphere.
        others: Moving bodies that a close-up ignores: other robots of the cell, a ghost.
        fixtures: Static bodies around the robot.
        floor: Height of the floor; None: no floor.
        lines: Trails, paths, axes.
    """

    parts: tuple[Part, ...]
    center: FloatArray
    radius: float
    others: tuple[Part, ...] = ()
    fixtures: tuple[Part, ...] = ()
    floor: float | None = 0.0
    lines: tuple[Line, ...] = ()


def square_m(radius: float) -> float:
    """Return the width of the floor's small squares [m] for a workspace radius [m]: a power of ten.

    Five small squares make a large one.
    """
    return float(10.0 ** np.round(np.log10(max(radius, 1e-3) / 8.0)))
