"""Whether two touch between one sample of a motion and the next, where neither sample shows it."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from robots.collision.geometry import Body, transform
from robots.collision.path import SAMPLE_M, corners_along
from robots.joints import FloatArray

# Between two looks nobody comes farther than this, where the two may touch.
FINEST_M = 1e-4
# Over so short a way, what goes round is longer than straight by no more than this.
ROUND = 1.01


class Placed:
    """An arm's bodies in one position, and on the way there, as coal has them; only those that are asked for.

    Args:
        placements: (b, 4, 4) to the site [m].
        before: (b, 4, 4) at the sample before; its own at the first.
        steps: (b,) how far each has come since then [m].
    """

    def __init__(self, placements: FloatArray, before: FloatArray, steps: FloatArray) -> None:
        self.steps = steps
        # Where somebody comes farther, a path begins anew: nobody goes from there to here.
        self.joined = bool(steps.max(initial=0.0) <= SAMPLE_M * ROUND)
        self._placements, self._before = placements, before
        self._transforms: dict[int, Any] = {}

    def __getitem__(self, body: int) -> Any:
        found = self._transforms.get(body)
        if found is None:
            found = self._transforms[body] = transform(self._placements[body])
        return found

    def on_the_way(self, body: int, share: float) -> Any:
        """A body's placement between the sample before (0) and this one (1)."""
        ends = pin.SE3(self._before[body]), pin.SE3(self._placements[body])
        return transform(pin.SE3.Interpolate(*ends, share).homogeneous)

    def way(self, one: int, other: int, body: Body) -> float:
        """How far a body comes as another sees it, since the sample before [m].

        Args:
            other: The number of `body`.
        """
        seen = np.array(
            [np.linalg.solve(at[one], at[other])[None] for at in (self._before, self._placements)]
        )
        before, now = corners_along((body,), seen)[:, 0]
        return float(np.linalg.norm(now - before, axis=1).max())


def touching_share(measure: Callable[[float], float], before_m: float, after_m: float, way_m: float) -> float:
    """The share of the way at which two touch; negative: they do not, as far as looks within FINEST_M tell.

    Args:
        measure: Their distance at a share of the way [m], or less, if it is above 0; 0: they touch.
        before_m, after_m: The same at the shares 0 and 1.
        way_m: How far they come, the one as the other sees it, in all.
    """
    left = [(0.0, 1.0, before_m, after_m)]
    while left:
        first, last, before_m, after_m = left.pop()
        way = (last - first) * way_m
        # Who is some way off at both ends, and comes no farther than both together, does not get there.
        if before_m + after_m > way * ROUND or way < FINEST_M:
            continue
        middle = (first + last) / 2
        distance = measure(middle)
        if distance == 0.0:
            return middle
        left += [(middle, last, distance, after_m), (first, middle, before_m, distance)]
    return -1.0
