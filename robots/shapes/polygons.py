"""Triangulation of polygons: fans for convex ones, ear clipping for the others.

Polygons are given as (c,) point numbers of the corners of all polygons in order, and (p,) numbers of
corners of each polygon, at least three.
"""

import numpy as np
from numpy.typing import NDArray

from robots.shapes.geometry import FloatArray, IndexArray

# Costs in units of sorting one corner: to test a corner for an ear, to test one point inside the ear, and
# to skip a reflex corner.
_TRY = 1000
_LOOK = 50
_STEP = 10
# A corner needs a try or two. The budget beyond that is a few seconds for a whole file.
_A_CORNER = 3 * _TRY
_BEYOND = 150_000_000
# The shortest corner in a file: a digit and a separator.
_CORNER_BYTES = 2


class Effort:
    """The work budget for the polygons of one file; when it is spent, the rest is cut without tests."""

    def __init__(self) -> None:
        self.left = _BEYOND
        self._corners_in_file = 0

    def read(self, size_bytes: int) -> None:
        """Allow grants for the corners that a file of this size can contain, each once.

        A few bytes can draw the same corners a million times (PROTO, USE, INSERT).
        """
        self._corners_in_file += size_bytes // _CORNER_BYTES

    def grant(self, corners: int) -> None:
        """Add the work that ordinary polygons with this many corners need."""
        granted = min(corners, self._corners_in_file)
        self._corners_in_file -= granted
        self.left += _A_CORNER * granted

    @property
    def spent(self) -> bool:
        """True if the budget is spent: triangles may then overlap or leave their polygon."""
        return self.left < 0


def starts_of(sizes: IndexArray) -> IndexArray:
    """Return the (p,) indices of each polygon's first corner."""
    starts: IndexArray = np.cumsum(sizes) - sizes
    return starts


def fans(sizes: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Return the (t, 3) corners of the triangles of convex polygons, and each triangle's (t,) polygon."""
    if (sizes == 3).all():
        return np.arange(3 * len(sizes)).reshape(-1, 3), np.arange(len(sizes))
    counts = sizes - 2
    owners = np.repeat(np.arange(len(sizes)), counts)
    first = starts_of(sizes)[owners]
    step = first + np.arange(len(owners)) - np.repeat(starts_of(counts), counts)
    return np.column_stack([first, step + 1, step + 2]), owners


def area_vectors(points: FloatArray, corners: IndexArray, sizes: IndexArray) -> FloatArray:
    """Return the (p, 3) Newell normals of the polygons, with a length of twice the area.

    Seen from the tip of its normal, a polygon runs counter-clockwise.
    """
    if not len(sizes):
        return np.zeros((0, 3))
    starts = starts_of(sizes)
    if (sizes == 3).all():
        a, b, c = (points[corners[k::3]] for k in range(3))
        return cross(b - a, c - a)
    # Relative to the first corner: far from the origin the plain sum would lose digits.
    arms = points[corners] - np.repeat(points[corners[starts]], sizes, axis=0)
    following = np.arange(1, len(corners) + 1)
    following[starts + sizes - 1] = starts
    result: FloatArray = np.add.reduceat(cross(arms, arms[following]), starts, axis=0)
    return result


def cross(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return (n, 3) cross products, three times as fast as `numpy.cross`."""
    result = np.empty_like(one)
    for axis in range(3):
        second, third = (axis + 1) % 3, (axis + 2) % 3
        result[:, axis] = one[:, second] * other[:, third] - one[:, third] * other[:, second]
    return result


def bent_inwards(points: FloatArray, corners: IndexArray, sizes: IndexArray) -> NDArray[np.bool_]:
    """Return a (p,) mask of the polygons with a reflex corner, which a fan cannot triangulate."""
    starts = starts_of(sizes)
    before, after = np.arange(-1, len(corners) - 1), np.arange(1, len(corners) + 1)
    before[starts] = starts + sizes - 1
    after[starts + sizes - 1] = starts
    here = points[corners]
    turns = cross(here - here[before], here[after] - here)
    areas = np.repeat(area_vectors(points, corners, sizes), sizes, axis=0)
    outwards = np.einsum("ij,ij->i", turns, areas) > 0
    bent: NDArray[np.bool_] = ~np.logical_and.reduceat(outwards, starts)
    return bent


def ears(corners: FloatArray, effort: Effort) -> IndexArray:
    """Triangulate a simple polygon by ear clipping.

    Args:
        corners: (n, 3), nearly in a plane.
        effort: Work budget; reduced by this call.

    Returns:
        (n - 2, 3) corner numbers, with the polygon's winding.
    """
    normal = area_vectors(corners, np.arange(len(corners)), np.array([len(corners)]))[0]
    # Projected along the largest component of the normal, which keeps shape and winding.
    axis = int(np.argmax(np.abs(normal)))
    flat = corners[:, [(axis + 1) % 3, (axis + 2) % 3]]
    if normal[axis] < 0:
        flat = flat[:, ::-1]
    return np.array(_Clipping(flat, effort).triangles(), dtype=np.int64)


class _Clipping:
    """A counter-clockwise ring of corners from which ears are cut one by one."""

    def __init__(self, flat: FloatArray, effort: Effort) -> None:
        self.x: list[float] = flat[:, 0].tolist()
        self.y: list[float] = flat[:, 1].tolist()
        count = len(flat)
        self.before = [count - 1, *range(count - 1)]
        self.after = [*range(1, count), 0]
        self.flat = flat
        # Only a reflex corner can be inside an ear; a corner that becomes convex stays convex.
        self.inward = np.array([self.turn(corner) <= 0 for corner in range(count)])
        self.sort(np.argsort(flat[:, 0]))
        self.effort = effort

    def sort(self, order: IndexArray) -> None:
        """Keep the reflex corners of those given, which are ordered by x."""
        self.order = order[self.inward[order]]
        self.sorted_x = self.flat[self.order, 0]
        self.gone = 0

    def triangles(self) -> list[tuple[int, int, int]]:
        found = []
        corner, missed, left = 0, 0, len(self.x)
        while left > 3:
            if missed < left and not self.effort.spent and (self.inward[corner] or not self.is_ear(corner)):
                self.effort.left -= _STEP
                corner, missed = self.after[corner], missed + 1
                continue
            # Cut here even without an ear if no corner is one (the polygon crosses itself or is flat) or
            # the budget is spent.
            before, after = self.before[corner], self.after[corner]
            found.append((before, corner, after))
            self.after[before], self.before[after] = after, before
            for neighbour in (before, corner, after):
                if self.inward[neighbour] and (neighbour == corner or self.turn(neighbour) > 0):
                    self.inward[neighbour] = False
                    self.gone += 1
            if self.gone > len(self.order) // 2 and not self.effort.spent:
                self.sort(self.order)
            # The next ear is probably next to this one. Alternate the sides, or all triangles would be long
            # and thin and share one corner.
            corner, missed, left = before if left % 2 else after, 0, left - 1
        found.append((self.before[corner], corner, self.after[corner]))
        return found

    def turn(self, corner: int) -> float:
        return self.side(self.before[corner], corner, self.after[corner])

    def side(self, a: int, b: int, c: int) -> float:
        """Return a positive number if c is left of the line from a to b."""
        x, y = self.x, self.y
        return (x[b] - x[a]) * (y[c] - y[b]) - (y[b] - y[a]) * (x[c] - x[b])

    def is_ear(self, corner: int) -> bool:
        a, b, c = self.before[corner], corner, self.after[corner]
        tips = self.flat[[a, b, c]]
        low, high = tips.min(axis=0), tips.max(axis=0)
        # Reflex corners within the ear's bounding box.
        near = self.order[
            np.searchsorted(self.sorted_x, low[0]) : np.searchsorted(self.sorted_x, high[0], side="right")
        ]
        self.effort.left -= _TRY + len(near)
        heights = self.flat[near, 1]
        near = near[self.inward[near] & (heights >= low[1]) & (heights <= high[1])]
        x, y = self.x, self.y
        tip_positions = {(x[a], y[a]), (x[b], y[b]), (x[c], y[c])}
        for other in near.tolist():
            self.effort.left -= _LOOK
            # A bridge to a hole visits a point twice, so a corner at the same position does not count.
            if (x[other], y[other]) in tip_positions:
                continue
            if self.side(a, b, other) >= 0 and self.side(b, c, other) >= 0 and self.side(c, a, other) >= 0:
                return False
        return True
