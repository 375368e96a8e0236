"""Bodies to model with: turned profiles, lofted sections, plates. Each is (vertices, triangles), outwards."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from robots.meshes.mesh import FloatArray, IndexArray

Solid = tuple[FloatArray, IndexArray]
Profile = Sequence[tuple[float, float]]


def turned(profile: Profile, segments: int) -> Solid:
    """A profile of (radius, z) turned about z; upwards along the outside: counter-clockwise from outside.

    A radius of zero is one point on the axis. Whole circles only; open ends stay open.
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
    """Closed sections, (n, 3) each of as many points, joined and closed at both ends.

    Each section runs counter-clockwise when the next section lies towards the viewer.
    """
    count = len(sections[0])
    rings = [np.arange(count) + count * number for number in range(len(sections))]
    start, end = len(sections) * count, len(sections) * count + 1
    vertices = np.concatenate([*sections, [sections[0].mean(axis=0)], [sections[-1].mean(axis=0)]])
    ends = [np.full(count, start), *rings, np.full(count, end)]
    return vertices, _skin(ends)


def _skin(rings: Sequence[IndexArray]) -> IndexArray:
    """Triangles between rings of vertex numbers that follow one another; those without area are left out."""
    pieces = []
    for below, above in pairwise(rings):
        next_below, next_above = np.roll(below, -1), np.roll(above, -1)
        pieces.append(np.column_stack([below, next_below, next_above]))
        pieces.append(np.column_stack([below, next_above, above]))
    triangles: IndexArray = np.concatenate(pieces).astype(np.int64)
    a, b, c = triangles.T
    kept: IndexArray = triangles[(a != b) & (b != c) & (c != a)]
    return kept


def box(low: FloatArray, high: FloatArray) -> Solid:
    """A box between two corners, (3,) each."""
    x, y, z = np.meshgrid(*np.column_stack([low, high]), indexing="ij")
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return vertices, np.array(triangles, dtype=np.int64)


def ball(radius: float, segments: int) -> Solid:
    """A sphere about the origin."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, segments // 2 + 1)[1:-1]
    middle = [(radius * float(np.cos(angle)), radius * float(np.sin(angle))) for angle in angles]
    return turned([(0.0, -radius), *middle, (0.0, radius)], segments)
