"""Unit and upward axis of an imported shape file, as stated by the file or guessed from its size."""

from dataclasses import dataclass

import numpy as np

from robots.shapes.geometry import Y_UP_TO_Z_UP, FloatArray, Geometry, bounds

# A robot's link, from a small wrist to a long boom [m].
LEAST_M, MOST_M = 0.005, 5.0
# Units that robots' files use. Few sizes fit both: from 5 units on, the unit is the millimetre.
_LIKELY = (0.001, 1.0)
_NAMES = {0.001: "millimetres", 1.0: "metres", 0.01: "centimetres", 0.0254: "inches", 0.3048: "feet"}


@dataclass(frozen=True)
class Guess:
    """The unit and the upward axis of a file.

    Attributes:
        scale_m: Length of the unit [m].
        up: Upward axis, "y" or "z".
        sentence: The reason, for the operator.
    """

    scale_m: float
    up: str
    sentence: str


def guess(geometry: Geometry) -> Guess:
    """Return the file's unit and upward axis.

    A missing unit is guessed: the one in which the shape is as large as a robot's link. A missing axis (VRML,
    3DS, STL, OBJ, PLY) is z, as is usual for robots.
    """
    low, high = bounds(geometry)
    size = float((high - low).max())
    up = geometry.up or "z"
    axis = f"{up} up" + ("" if geometry.up else " assumed")
    if geometry.unit_m is not None:
        odd = "" if size == 0 or LEAST_M <= size * geometry.unit_m <= MOST_M else "; odd for a robot's link"
        return Guess(
            geometry.unit_m,
            up,
            f"in {_name(geometry.unit_m)}, as the file states: "
            f"{_length(size * geometry.unit_m)} large{odd}; {axis}",
        )
    if size == 0:
        return Guess(0.001, up, f"no triangles to judge the size by: millimetres assumed; {axis}")
    fitting = [unit for unit in _LIKELY if LEAST_M <= size * unit <= MOST_M]
    unit = fitting[0] if fitting else _LIKELY[0]
    why = f"{_length(size * unit)} large" + ("" if fitting else ", odd for a robot's link: check it")
    return Guess(unit, up, f"{_name(unit)} assumed, the file states no unit: {why}; {axis}")


def file_to_link(found: Guess) -> FloatArray:
    """Return the (4, 4) transform from the file's units and axes to metres, z up."""
    matrix = np.diag([found.scale_m, found.scale_m, found.scale_m, 1.0])
    if found.up == "y":
        matrix = Y_UP_TO_Z_UP @ matrix
    return matrix


def _name(unit: float) -> str:
    for known, name in _NAMES.items():
        if np.isclose(unit, known, rtol=1e-6):
            return name
    return f"units of {unit:g} m"


def _length(metres: float) -> str:
    return f"{metres * 1000:.3g} mm" if metres < 1 else f"{metres:.3g} m"
