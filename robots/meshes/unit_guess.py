"""What a mesh file's numbers are on import: its unit and its upward axis, stated or guessed from size."""

from dataclasses import dataclass

import numpy as np

from robots.meshes.mesh import FloatArray, Mesh, bounds

# A robot's link, from a small wrist to a long boom [m].
LEAST_M, MOST_M = 0.005, 5.0
# What robots' files are in. Hardly a size fits both: from 5 units on they are millimetres.
_LIKELY = (0.001, 1.0)
_NAMES = {0.001: "millimetres", 1.0: "metres", 0.01: "centimetres", 0.0254: "inches", 0.3048: "feet"}


@dataclass(frozen=True)
class Guess:
    """How to bring a file's numbers into a link's frame.

    Attributes:
        scale_m: Length of its unit [m].
        up: Its upward axis, "y" or "z".
        sentence: Why, for people.
    """

    scale_m: float
    up: str
    sentence: str


def guess(mesh: Mesh) -> Guess:
    """Unit and upward axis: what the file states; else the unit in which it is as large as a robot's link.

    Files that say nothing (VRML, 3DS, STL, OBJ, PLY) are taken z up, as robots' are.
    """
    low, high = bounds(mesh)
    size = float((high - low).max())
    up = mesh.up or "z"
    axis = f"{up} up" + ("" if mesh.up else " taken")
    if mesh.unit_m is not None:
        odd = "" if size == 0 or LEAST_M <= size * mesh.unit_m <= MOST_M else "; odd for a robot's link"
        return Guess(
            mesh.unit_m,
            up,
            f"in {_name(mesh.unit_m)}, as the file says: {_length(size * mesh.unit_m)} large{odd}; {axis}",
        )
    if size == 0:
        return Guess(0.001, up, f"holds no triangles to judge by: taken for millimetres; {axis}")
    fitting = [unit for unit in _LIKELY if LEAST_M <= size * unit <= MOST_M]
    unit = fitting[0] if fitting else _LIKELY[0]
    why = f"{_length(size * unit)} large" + ("" if fitting else ", odd for a robot's link: check it")
    return Guess(unit, up, f"taken for {_name(unit)}, for it says no unit: {why}; {axis}")


def file_to_link(found: Guess) -> FloatArray:
    """(4, 4) from the file's units and axes to metres, z up."""
    matrix = np.diag([found.scale_m, found.scale_m, found.scale_m, 1.0])
    if found.up == "y":
        turned = np.eye(4)
        turned[1:3, 1:3] = [[0.0, -1.0], [1.0, 0.0]]  # y to z, z to -y
        matrix = turned @ matrix
    return matrix


def _name(unit: float) -> str:
    for known, name in _NAMES.items():
        if np.isclose(unit, known, rtol=1e-6):
            return name
    return f"units of {unit:g} m"


def _length(metres: float) -> str:
    return f"{metres * 1000:.3g} mm" if metres < 1 else f"{metres:.3g} m"
