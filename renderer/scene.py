"""What stands where: pure data that a drawing takes."""

from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class Finish(Enum):
    """How a body is painted."""

    PLAIN = auto()
    STALE = auto()  # grey: it was so once, and nobody knows whether it is
    RED = auto()  # it touches something
    GHOST = auto()  # blue and translucent: it is not there, but may be


@dataclass(frozen=True, eq=False)
class Part:
    """A body of the scene.

    Attributes:
        mesh: Name under which its mesh was given to the drawing.
        part_to_site: (4, 4).
        name: What it is called: a link, a fixture.
    """

    mesh: str
    part_to_site: FloatArray
    finish: Finish = Finish.PLAIN
    name: str = ""


@dataclass(frozen=True, eq=False)
class Line:
    """A line through points, hidden by what stands before it.

    Attributes:
        points: (n, 3) in the site's frame [m].
        color: Red, green, blue, 0 to 1 (sRGB).
        opacity: (n,) at each point, 0 to 1.
        width: In a picture 720 px high [px].
    """

    points: FloatArray
    color: tuple[float, float, float]
    opacity: FloatArray
    width: float = 2.0


@dataclass(frozen=True, eq=False)
class Scene:
    """All that one picture shows, in the site's frame [m].

    Attributes:
        parts: What moves, and what a close-up is of.
        center: (3,) of the sphere that holds the arm's room.
        radius: Its radius.
        others: What moves too, and no close-up is of: other robots of the cell, a ghost.
        fixtures: What stands around.
        floor: Height of the floor; None: there is none.
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
    """Width of the floor's small squares around a room of that radius [m]: 0.1, or ten times more or less.

    Five of them are a large square.
    """
    return float(10.0 ** np.round(np.log10(max(radius, 1e-3) / 8.0)))
