"""What stands where: pure data that a drawing takes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Part:
    """A body of the scene.

    Attributes:
        mesh: Name under which its mesh was given to the drawing.
        part_to_site: (4, 4).
    """

    mesh: str
    part_to_site: FloatArray


@dataclass(frozen=True, eq=False)
class Scene:
    """All that one picture shows, in the site's frame [m].

    Attributes:
        center: (3,) of the sphere that holds all of it.
        radius: Its radius.
        floor: Height of the floor.
        stale: 0: what is shown is so now; 1: it was so once, and is drawn grey.
    """

    parts: tuple[Part, ...]
    center: FloatArray
    radius: float
    floor: float = 0.0
    stale: float = 0.0
