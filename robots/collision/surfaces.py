"""Surfaces of links as triangles: do two touch, or is one inside the other?"""

from functools import cached_property
from typing import Any

import coal
import numpy as np

from robots.collision.geometry import TOUCH_M, exact_body, piece_points, transform
from robots.joints import FloatArray

# A closed surface goes around a point inside it once, around one in a hollow of it not at all.
_INSIDE = 0.9


class Surface:
    """The surface of a link, (n, 3, 3) corners of triangles [m], n at least 1."""

    def __init__(self, triangles: FloatArray) -> None:
        self.triangles = triangles

    @cached_property
    def exact(self) -> Any:
        """Coal's mesh of it."""
        return exact_body(self.triangles).geometry

    @cached_property
    def points(self) -> FloatArray:
        """A corner of each piece that hangs together: (k, 3)."""
        return np.array([points[0] for points in piece_points(self.triangles)])

    def holds(self, points: FloatArray) -> bool:
        """Return whether one of some points (k, 3) is inside; an open surface holds none."""
        low, high = self.triangles.min(axis=(0, 1)), self.triangles.max(axis=(0, 1))
        within = points[((points > low) & (points < high)).all(axis=1)]
        return any(abs(turns_around(self.triangles, point)) > _INSIDE for point in within)


def turns_around(triangles: FloatArray, point: FloatArray) -> float:
    """How many times a surface goes around a point: the solid angles of its triangles.

    Source: Van Oosterom, Strackee 1983; Jacobson, Kavan, Sorkine-Hornung 2013.
    """
    a, b, c = np.moveaxis(triangles - point, 1, 0)
    to_a, to_b, to_c = (np.linalg.norm(each, axis=1) for each in (a, b, c))
    above = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = to_a * to_b * to_c
    for one, other, length in ((a, b, to_c), (b, c, to_a), (c, a, to_b)):
        below += np.einsum("ij,ij->i", one, other) * length
    return float(np.arctan2(above, below).sum()) / (2 * np.pi)


class Touch:
    """Says whether two surfaces touch, or one is inside the other; keeps coal's workspace."""

    def __init__(self) -> None:
        self._request, self._result = coal.CollisionRequest(), coal.CollisionResult()
        self._request.security_margin = 2 * TOUCH_M

    def __call__(self, one: Surface, other: Surface, other_to_one: FloatArray) -> bool:
        """Return whether they touch, with the (4, 4) placement of the other in the one's frame."""
        return self.surfaces(one, other, other_to_one) or self.inside(one, other, other_to_one)

    def surfaces(self, one: Surface, other: Surface, other_to_one: FloatArray) -> bool:
        """Return whether their triangles touch."""
        self._result.clear()
        there = transform(other_to_one)
        return bool(coal.collide(one.exact, _HERE, other.exact, there, self._request, self._result))

    def inside(self, one: Surface, other: Surface, other_to_one: FloatArray) -> bool:
        """Return whether a piece of one is inside the other, of two whose triangles are apart."""
        rotation, origin = other_to_one[:3, :3], other_to_one[:3, 3]
        # A piece is then wholly inside, or wholly outside.
        return one.holds(other.points @ rotation.T + origin) or other.holds((one.points - origin) @ rotation)


_HERE = coal.Transform3s(np.eye(3), np.zeros(3))
