"""Contact test for two links' surfaces, including one inside the other."""

from functools import cached_property
from typing import Any

import coal
import numpy as np

from robots.bodies.geometry import TOUCH_M, exact_body, piece_points, transform
from robots.kinematics.joints import FloatArray

# The winding number of a closed surface is 1 for a point inside it, and 0 for a point in a cavity.
_INSIDE = 0.9


class Surface:
    """The surface of a link, (n, 3, 3) corners of triangles [m], n at least 1."""

    def __init__(self, triangles: FloatArray) -> None:
        self.triangles = triangles

    @cached_property
    def exact(self) -> Any:
        """Coal's geometry of the surface."""
        return exact_body(self.triangles).geometry

    @cached_property
    def points(self) -> FloatArray:
        """A corner of each connected piece: (k, 3)."""
        return np.array([points[0] for points in piece_points(self.triangles)])

    def contains_any(self, points: FloatArray) -> bool:
        """Return whether one of the points (k, 3) is inside; false for an open surface."""
        low, high = self.triangles.min(axis=(0, 1)), self.triangles.max(axis=(0, 1))
        within = points[((points > low) & (points < high)).all(axis=1)]
        return any(abs(winding_number(self.triangles, point)) > _INSIDE for point in within)


def winding_number(triangles: FloatArray, point: FloatArray) -> float:
    """Return the winding number of a surface around a point, from the solid angles of its triangles.

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
    """Contact test of two surfaces, with coal's workspace."""

    def __init__(self) -> None:
        self._request, self._result = coal.CollisionRequest(), coal.CollisionResult()
        self._request.security_margin = 2 * TOUCH_M

    def __call__(self, one: Surface, other: Surface, other_to_one: FloatArray) -> bool:
        """Return whether the surfaces touch or one is inside the other.

        Args:
            other_to_one: (4, 4) placement of the second in the first's frame.
        """
        return self.surfaces_touch(one, other, other_to_one) or self.is_inside(one, other, other_to_one)

    def surfaces_touch(self, one: Surface, other: Surface, other_to_one: FloatArray) -> bool:
        """Return whether their triangles touch."""
        self._result.clear()
        there = transform(other_to_one)
        return bool(coal.collide(one.exact, _HERE, other.exact, there, self._request, self._result))

    def is_inside(self, one: Surface, other: Surface, other_to_one: FloatArray) -> bool:
        """Return whether a piece of one surface is inside the other; their triangles must not touch."""
        rotation, origin = other_to_one[:3, :3], other_to_one[:3, 3]
        # A piece is completely inside or outside, so one of its corners is enough.
        if one.contains_any(other.points @ rotation.T + origin):
            return True
        return other.contains_any((one.points - origin) @ rotation)


_HERE = coal.Transform3s(np.eye(3), np.zeros(3))
