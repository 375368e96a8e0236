"""Constructors of solids: turned profiles, lofted sections, plates, tubes.

A solid is (vertices, triangles), with triangles counter-clockwise seen from outside. Outlines are (n, 2),
counter-clockwise.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from robots.shapes.geometry import FloatArray, IndexArray, unit

Solid = tuple[FloatArray, IndexArray]
Profile = Sequence[tuple[float, float]]


def turned(profile: Profile, segments: int) -> Solid:
    """Return the solid of a profile of (radius, z) rotated about z; z increases along the outside.

    A radius of zero is one point on the axis. A profile that does not begin or end on the axis stays open.
    """
    angles = np.arange(segments) * (2 * np.pi / segments)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    vertices: list[FloatArray] = []
    rings: list[IndexArray] = []
    count = 0
    for radius, z in profile:
        size = 1 if radius == 0 else segments
        ring = np.zeros((size, 3))
        ring[:, :2] = circle[:size] * radius
        ring[:, 2] = z
        vertices.append(ring)
        rings.append(np.resize(np.arange(count, count + size), segments))
        count += size
    return np.concatenate(vertices), _skin(rings)


def lofted(sections: Sequence[FloatArray]) -> Solid:
    """Return the solid that joins closed sections, (n, 3) each, and is closed at both ends.

    All sections have the same number of points. Each runs counter-clockwise seen from the next one.
    The first and the last must be star-shaped.
    """
    count = len(sections[0])
    rings = [np.arange(count) + count * number for number in range(len(sections))]
    start, end = len(sections) * count, len(sections) * count + 1
    vertices = np.concatenate([*sections, [sections[0].mean(axis=0)], [sections[-1].mean(axis=0)]])
    return vertices, _skin([np.full(count, start), *rings, np.full(count, end)])


def _skin(rings: Sequence[IndexArray]) -> IndexArray:
    """Return the triangles between consecutive rings of vertex numbers, without degenerate ones."""
    pieces = []
    for below, above in pairwise(rings):
        next_below, next_above = np.roll(below, -1), np.roll(above, -1)
        pieces.append(np.column_stack([below, next_below, next_above]))
        pieces.append(np.column_stack([below, next_above, above]))
    triangles: IndexArray = np.concatenate(pieces).astype(np.int64)
    a, b, c = triangles.T
    kept: IndexArray = triangles[(a != b) & (b != c) & (c != a)]
    return kept


def rounded(profile: Profile, radius: float, steps: int = 2) -> list[tuple[float, float]]:
    """Return a profile with filleted inner corners; a fillet shrinks where its neighbours are close."""
    points = np.array(profile, dtype=np.float64)
    result = [points[0]]
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        to_before, to_after = before - corner, after - corner
        lengths = np.linalg.norm(to_before), np.linalg.norm(to_after)
        to_before, to_after = to_before / lengths[0], to_after / lengths[1]
        half = np.arccos(np.clip(to_before @ to_after, -1, 1)) / 2
        if half > np.radians(80):  # nearly straight
            result.append(corner)
            continue
        reach = min(radius / np.tan(half), 0.48 * min(lengths))
        # A quadratic curve tangent to both sides, which looks like an arc.
        for t in np.linspace(0, 1, steps + 1):
            start, end = corner + reach * to_before, corner + reach * to_after
            result.append((1 - t) ** 2 * start + 2 * t * (1 - t) * corner + t**2 * end)
    result.append(points[-1])
    return [(float(r), float(z)) for r, z in result]


def rectangle(width: float, height: float, radius: float, steps: int = 5) -> FloatArray:
    """Return the (4 (steps + 1), 2) outline of a rectangle with round corners, centred on the origin."""
    radius = min(radius, width / 2 * 0.999, height / 2 * 0.999)
    points = []
    for quarter, (x, y) in enumerate([(1, 1), (-1, 1), (-1, -1), (1, -1)]):
        angles = (quarter + np.linspace(0, 1, steps + 1)) * (np.pi / 2)
        center = np.array([x * (width / 2 - radius), y * (height / 2 - radius)])
        points.append(center + radius * np.column_stack([np.cos(angles), np.sin(angles)]))
    return np.concatenate(points)


def strap(
    start: FloatArray, start_radius: float, end: FloatArray, end_radius: float, count: int
) -> FloatArray:
    """Return the (count, 2) outline of a band around two circles; `count` is even."""
    along = np.subtract(end, start)
    length = float(np.linalg.norm(along))
    heading = float(np.arctan2(along[1], along[0]))
    lean = float(np.arccos((start_radius - end_radius) / length))
    ahead = np.linspace(-lean, lean, count // 2) + heading
    behind = np.linspace(lean, 2 * np.pi - lean, count // 2) + heading
    return np.concatenate(
        [
            np.add(end, end_radius * np.column_stack([np.cos(ahead), np.sin(ahead)])),
            np.add(start, start_radius * np.column_stack([np.cos(behind), np.sin(behind)])),
        ]
    )


def plate(outline: FloatArray, low: float, high: float, bevel: float, steps: int = 3) -> Solid:
    """Return a plate with a convex outline in x and y, from z low to z high, with rounded edges."""
    turns = np.linspace(0, np.pi / 2, steps + 1)
    below = [(bevel * (1 - np.sin(turn)), low + bevel * (1 - np.cos(turn))) for turn in turns]
    above = [(inset, high + low - z) for inset, z in reversed(below)]
    return lofted(
        [np.column_stack([shrunk(outline, inset), np.full(len(outline), z)]) for inset, z in [*below, *above]]
    )


def shrunk(outline: FloatArray, inset: float) -> FloatArray:
    """Return a convex outline moved inwards."""
    along = np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0)
    outwards = unit(np.column_stack([along[:, 1], -along[:, 0]]))
    return outline - inset * outwards


def tube(path: FloatArray, radius: float, segments: int) -> Solid:
    """Return a round tube along (n, 3) points, closed at both ends."""
    directions = unit(np.gradient(path, axis=0))
    side = np.cross(directions[0], np.eye(3)[int(np.argmin(np.abs(directions[0])))])
    angles = np.arange(segments) * (2 * np.pi / segments)
    sections = []
    for point, direction in zip(path, directions, strict=True):
        # Carried along the path, so that the tube does not twist.
        side = unit((side - (side @ direction) * direction)[None])[0]
        other = np.cross(direction, side)
        sections.append(point + radius * (np.outer(np.cos(angles), side) + np.outer(np.sin(angles), other)))
    return lofted(sections)


def box(low: FloatArray, high: FloatArray) -> Solid:
    """Return a box between two corners, (3,) each."""
    x, y, z = np.meshgrid(*np.column_stack([low, high]), indexing="ij")
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return vertices, np.array(triangles, dtype=np.int64)


def ball(radius: float, segments: int) -> Solid:
    """Return a sphere centred on the origin."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, segments // 2 + 1)[1:-1]
    middle = [(radius * float(np.cos(angle)), radius * float(np.sin(angle))) for angle in angles]
    return turned([(0.0, -radius), *middle, (0.0, radius)], segments)


def moved(solid: Solid, placement: FloatArray) -> Solid:
    """Return a solid moved by a (4, 4) transform; a mirroring one reverses the triangles' winding."""
    vertices, triangles = solid
    linear = placement[:3, :3]
    reversed_triangles = triangles[:, ::-1] if np.linalg.det(linear) < 0 else triangles
    return vertices @ linear.T + placement[:3, 3], reversed_triangles
