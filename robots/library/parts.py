"""Parts of arms: hubs, cheeks, motor housings, bolts, covers; in millimetres.

A piece is a material and a solid. Round pieces are made along z and then moved into place.
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np

from robots.shapes.geometry import FloatArray, Geometry, Material, Part
from robots.shapes.normals import creased
from robots.shapes.solids import Profile, Solid, lofted, moved, plate, rectangle, rounded, strap, turned

Piece = tuple[Material, Solid]

PAINT = Material("paint", (0.85, 0.51, 0.17), (0.3, 0.3, 0.3), shininess=0.4)
CASTING = Material("casting", (0.21, 0.225, 0.24), (0.2, 0.2, 0.2), shininess=0.25)
STEEL = Material("steel", (0.74, 0.76, 0.78), (0.8, 0.8, 0.8), shininess=0.7)
RUBBER = Material("rubber", (0.09, 0.09, 0.1), (0.05, 0.05, 0.05), shininess=0.05)

# Faces that meet at a smaller angle are one smooth surface.
CREASE = np.radians(36)


def at(x: float = 0.0, y: float = 0.0, z: float = 0.0, *, axis: str = "+z") -> FloatArray:
    """Return the (4, 4) transform that moves the origin to a point and turns z to another axis ("-y")."""
    columns = {
        "+z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        "-z": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
        "+x": [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
        "-x": [[0, 1, 0], [0, 0, -1], [-1, 0, 0]],
        "+y": [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
        "-y": [[0, 0, 1], [-1, 0, 0], [0, -1, 0]],
    }
    # Rows: the images of x, y and z.
    placement = np.eye(4)
    placement[:3, :3] = np.array(columns[axis], dtype=np.float64).T
    placement[:3, 3] = (x, y, z)
    return placement


def laid(pieces: Iterable[Piece], placement: FloatArray) -> list[Piece]:
    """Return pieces moved by a (4, 4) transform."""
    return [(material, moved(solid, placement)) for material, solid in pieces]


def turned_piece(material: Material, profile: Profile, *, fillet: float = 0.0) -> Piece:
    """Return a turned body with rounded corners."""
    largest = max(radius for radius, _ in profile)
    return material, turned(rounded(profile, fillet) if fillet else profile, _segments(largest))


def _segments(radius: float) -> int:
    """Return the number of segments that makes a circle of this size look round."""
    sizes = [(45, 36), (30, 28), (8, 20), (0, 10)]
    return next(count for least, count in sizes if radius >= least)


def drum(material: Material, radius: float, low: float, high: float, *, fillet: float = 0.0) -> Piece:
    """Return a cylinder along z, with edges rounded by the fillet."""
    return turned_piece(material, [(0, low), (radius, low), (radius, high), (0, high)], fillet=fillet)


def bolts(
    circle: float, count: int, radius: float, low: float, high: float, *, start: float = 0.0
) -> list[Piece]:
    """Return socket-head bolts on a circle about z; `start` in degrees."""
    angles = np.radians(start) + np.arange(count) * (2 * np.pi / count)
    head: list[tuple[float, float]] = [(radius, low), (radius, high), (0, high)]
    if radius >= 8:  # the socket of a smaller bolt is invisible
        floor = high - 0.4 * radius
        head[1:] = [(radius, high - 0.2 * radius), (radius * 0.8, high)]
        head += [(radius * 0.5, high), (radius * 0.5, floor), (0, floor)]
    bolt = turned(head, _segments(radius))
    centers = circle * np.column_stack([np.cos(angles), np.sin(angles)])
    return [(STEEL, moved(bolt, at(x, y))) for x, y in centers.tolist()]


def motor(radius: float, low: float, high: float, *, fins: int = 5) -> list[Piece]:
    """Return a motor housing along z: a flange, cooling fins, a domed cap with bolts."""
    length = high - low
    cap = low + 0.72 * length
    profile: list[tuple[float, float]] = [(0, low), (radius, low), (radius, low + 0.1 * length)]
    groove = (cap - low - 0.14 * length) / (2 * fins)
    for fin in range(fins):
        z = low + 0.12 * length + 2 * groove * fin
        profile += [(radius * 0.9, z), (radius * 0.9, z + groove), (radius * 0.98, z + groove)]
        profile += [(radius * 0.98, z + 2 * groove)]
    profile += [(radius, cap), (radius, high - 0.14 * length), (radius * 0.86, high)]
    body = turned_piece(CASTING, [*profile, (0, high)])
    return [body, *bolts(radius * 0.66, 4, radius * 0.075, high - 1, high + radius * 0.06, start=45)]


def cover(
    radius: float, low: float, high: float, *, material: Material = CASTING, count: int = 6
) -> list[Piece]:
    """Return a bolted cover along z: a disc with a raised middle."""
    middle = low + 0.62 * (high - low)
    profile = [
        (0, low),
        (radius, low),
        (radius, middle),
        (radius * 0.62, middle),
        (radius * 0.56, high),
        (0, high),
    ]
    disc = turned_piece(material, profile, fillet=0.06 * radius)
    return [disc, *bolts(radius * 0.81, count, radius * 0.07, middle - 1, middle + radius * 0.05)]


def cheek(
    material: Material,
    start: Sequence[float],
    start_radius: float,
    end: Sequence[float],
    end_radius: float,
    low: float,
    high: float,
    *,
    bevel: float = 5.0,
) -> Piece:
    """Return a flat arm around two circles in x and y, from z low to z high."""
    outline = strap(np.array(start), start_radius, np.array(end), end_radius, count=36)
    return material, plate(outline, low, high, bevel)


def rounded_box(
    material: Material,
    size: Sequence[float],
    center: Sequence[float],
    *,
    radius: float = 8.0,
    bevel: float = 4.0,
) -> Piece:
    """Return a box with round corners about z and rounded edges."""
    outline = rectangle(size[0], size[1], radius, steps=3)
    solid = plate(outline, -size[2] / 2, size[2] / 2, bevel, steps=2)
    return material, moved(solid, at(*center))


def tapered(
    material: Material, stations: Sequence[tuple[float, float, float, float]], radius: float
) -> Piece:
    """Return a body along x through sections with round corners.

    Args:
        stations: (x, size along y, size along z, middle in y) of each section.
        radius: Radius of the sections' corners.
    """
    sections = []
    for x, along_y, along_z, middle in _eased(stations).tolist():
        flat = rectangle(along_y, along_z, radius, steps=4)
        sections.append(np.column_stack([np.full(len(flat), x), flat[:, 0] + middle, flat[:, 1]]))
    return material, lofted(sections)


# Rounding of a tapered body's ends: the inset of each side, and its distance from the end.
_END = np.array([[5.0, 0.0], [2.25, 0.8], [0.6, 2.5]])
_END_LENGTH = 5.0


def _eased(stations: Sequence[tuple[float, float, float, float]]) -> FloatArray:
    """Return (n, 4) stations with more between those given, so that sizes change smoothly, and round ends."""
    given = np.array(stations, dtype=np.float64)
    steps = np.linspace(0, 1, 4)[:-1, None]
    soft = steps * steps * (3 - 2 * steps)
    weights = np.hstack([steps, soft, soft, soft])
    between = [start + weights * (end - start) for start, end in pairwise(given)]
    sections = np.vstack([*between, given[-1:]])
    first, last = _rounded_end(given[0], 1), _rounded_end(given[-1], -1)
    sections[0, 0] += _END_LENGTH
    sections[-1, 0] -= _END_LENGTH
    return np.vstack([first, sections, last])


def _rounded_end(station: FloatArray, direction: int) -> FloatArray:
    sections = np.repeat(station[None], len(_END), axis=0)
    sections[:, 0] += direction * _END[:, 1]
    sections[:, 1:3] -= 2 * _END[:, :1]
    return sections[::direction]


def geometry_of(pieces: Iterable[Piece]) -> Geometry:
    """Return pieces as a shape with a part for each material, smooth except at creases."""
    by_material: dict[Material, list[Solid]] = {}
    for material, solid in pieces:
        by_material.setdefault(material, []).append(solid)
    return Geometry(tuple(_part(material, solids) for material, solids in by_material.items()))


def _part(material: Material, solids: Sequence[Solid]) -> Part:
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in solids)])
    vertices = np.concatenate([vertices for vertices, _ in solids])
    triangles = np.concatenate([faces + offset for (_, faces), offset in zip(solids, offsets, strict=False)])
    return Part(material.name, material, *creased(vertices, triangles, CREASE))
