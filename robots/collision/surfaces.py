"""Surfaces as triangles, cut into parts whose convex hulls are apart where the surfaces are.

A part is a piece of the surface itself, cut by planes, so the hulls of all parts cover all of it: no contact
is missed. Only two links that their hulls join are cut, and no further than it takes to part them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import coal
import numpy as np

from robots.collision.bodies import TOUCH_M, Body, exact_body, hull_body, transform
from robots.joints import FloatArray

# At most so many parts of a link to part it from another at home, and in the other positions.
MOST_PARTS, _MOST_FOR_OTHERS = 64, 64
# Shares of a part's extent at which it may be cut.
_CUTS = np.linspace(0.0, 1.0, 9)[1:-1]


@dataclass(frozen=True, eq=False)
class Part:
    """A piece of a surface, (n, 3, 3) corners of triangles [m], and its hull."""

    triangles: FloatArray

    @cached_property
    def body(self) -> Body:
        """The convex hull."""
        return hull_body(self.triangles.reshape(-1, 3))

    def halves(self) -> tuple["Part", "Part"]:
        """Cut it by the plane, of some across each axis, that leaves the least boxes about both halves."""
        corners = self.triangles.reshape(-1, 3)
        low, high = corners.min(axis=0), corners.max(axis=0)
        cuts = [(axis, low[axis] + share * (high - low)[axis]) for axis in range(3) for share in _CUTS]
        return min((cut(self.triangles, *each) for each in cuts), key=_boxes)


def cut(triangles: FloatArray, axis: int, at: float) -> tuple[Part, Part]:
    """The surface below and above a plane across an axis; triangles that cross it are cut."""
    above = triangles[:, :, axis] > at
    count = above.sum(axis=1)
    crossing = (count > 0) & (count < 3)
    apart = triangles[crossing]
    # The corner that is alone on its side comes first.
    lone_above = count[crossing] == 1
    lone = (above[crossing] == lone_above[:, None]).argmax(axis=1)
    order = (lone[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(apart, order[:, :, None], axis=1), 1, 0)
    to_b, to_c = (a + (b - a) * _share(a, b, axis, at), a + (c - a) * _share(a, c, axis, at))
    tips = np.stack([a, to_b, to_c], axis=1)
    rests = np.stack([to_b, b, c, to_b, c, to_c], axis=1).reshape(-1, 2, 3, 3)
    sides = []
    for side in (False, True):
        ours = lone_above == side
        whole = triangles[count == (3 if side else 0)]
        sides.append(Part(np.concatenate([whole, tips[ours], rests[~ours].reshape(-1, 3, 3)])))
    return sides[0], sides[1]


def _share(start: FloatArray, end: FloatArray, axis: int, at: float) -> FloatArray:
    share: FloatArray = ((at - start[:, axis]) / (end[:, axis] - start[:, axis]))[:, None]
    return share


def _boxes(halves: tuple[Part, Part]) -> float:
    """Areas of the boxes about two halves; infinite where one is empty."""
    if not all(len(half.triangles) for half in halves):
        return np.inf
    sizes = [np.ptp(half.triangles.reshape(-1, 3), axis=0) for half in halves]
    return sum(float(x * y + y * z + z * x) for x, y, z in sizes)


class Touch:
    """Says whether two bodies touch; keeps coal's workspace."""

    def __init__(self) -> None:
        self._request, self._result = coal.CollisionRequest(), coal.CollisionResult()
        self._request.security_margin = 2 * TOUCH_M

    def __call__(self, one: Any, other: Any, other_to_one: Any) -> bool:
        """Return whether coal's geometries touch.

        Args:
            other_to_one: Placement of the other in the one's frame, as coal has it.
        """
        self._result.clear()
        found: int = coal.collide(one, _HERE, other, other_to_one, self._request, self._result)
        return found > 0


_HERE = coal.Transform3s(np.eye(3), np.zeros(3))


class Surface:
    """The surface of a link, whole and as its hull."""

    def __init__(self, triangles: FloatArray) -> None:
        self.whole = Part(triangles)

    @cached_property
    def exact(self) -> Any:
        """Coal's mesh of it."""
        return exact_body(self.whole.triangles).geometry


def relative(one: FloatArray, other: FloatArray) -> list[Any]:
    """Placements (k, 4, 4) of one link in the frame of another, as coal has them."""
    return [transform(each) for each in np.linalg.solve(one, other)]


def parted(
    one: Surface, other: Surface, places: Sequence[Any], touch: Touch
) -> tuple[list[Part], list[Part]] | None:
    """Both surfaces in parts that do not touch at the first place, and at as few of the others as may be.

    Args:
        places: Of the other in the one's frame, where the surfaces do not touch; home first.

    Returns:
        The parts of each; None: the limit of parts did not suffice for the first place.
    """
    sides: tuple[list[Part], list[Part]] = ([one.whole], [other.whole])
    for number, place in enumerate(places):
        most = MOST_PARTS if number == 0 else _MOST_FOR_OTHERS
        while (met := _met(sides, place, touch)) is not None:
            side = _larger(sides, met)
            if len(sides[side]) >= most:
                if number == 0:
                    return None
                break
            part = sides[side][met[side]]
            sides[side][met[side] : met[side] + 1] = part.halves()
    return sides


def _met(sides: tuple[list[Part], list[Part]], place: Any, touch: Touch) -> tuple[int, int] | None:
    """Numbers of two parts that touch, the largest that do."""
    found = [
        (first, second)
        for first, one in enumerate(sides[0])
        for second, other in enumerate(sides[1])
        if touch(one.body.geometry, other.body.geometry, place)
    ]
    if not found:
        return None
    return max(found, key=lambda met: max(_extent(sides[side][met[side]]) for side in (0, 1)))


def _larger(sides: tuple[list[Part], list[Part]], met: tuple[int, int]) -> int:
    return int(_extent(sides[1][met[1]]) > _extent(sides[0][met[0]]))


def _extent(part: Part) -> float:
    return float(part.body.half.max())
