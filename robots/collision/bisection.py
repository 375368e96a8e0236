"""Search for a contact between two samples of a motion, if neither sample shows one."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from robots.bodies.geometry import Body, transform
from robots.collision.path import SAMPLE_M, corners_along
from robots.kinematics.joints import FloatArray

# The search ends at intervals in which the bodies travel less than this.
FINEST_M = 1e-4
# Largest ratio of arc length to chord for so short a way.
ROUND = 1.01


class Placed:
    """Coal's transforms of an arm's bodies at a sample and on the way to it, made on request.

    Args:
        placements: (b, 4, 4) to the site [m].
        before: (b, 4, 4) at the previous sample; at the first sample, equal to `placements`.
        steps: (b,) distance that each body travelled since then [m].
        joined: Whether the arm moves from the previous sample to this one; see `joined`.
    """

    def __init__(
        self, placements: FloatArray, before: FloatArray, steps: FloatArray, *, joined: bool
    ) -> None:
        self.steps, self.joined = steps, joined
        self._placements, self._before = placements, before
        self._transforms: dict[int, Any] = {}

    def __getitem__(self, body: int) -> Any:
        found = self._transforms.get(body)
        if found is None:
            found = self._transforms[body] = transform(self._placements[body])
        return found

    def interpolated(self, body: int, share: float) -> Any:
        """Return a body's placement between the previous sample (0) and this one (1)."""
        ends = pin.SE3(self._before[body]), pin.SE3(self._placements[body])
        return transform(pin.SE3.Interpolate(*ends, share).homogeneous)

    def way(self, one: int, other: int, body: Body) -> float:
        """Return how far a body travelled since the previous sample, relative to another body [m].

        Args:
            one: Number of the body that is the reference.
            other: Number of `body`.
        """
        seen = np.array(
            [np.linalg.solve(at[one], at[other])[None] for at in (self._before, self._placements)]
        )
        before, now = corners_along((body,), seen)[:, 0]
        return float(np.linalg.norm(now - before, axis=1).max())


def joined(steps: FloatArray) -> list[bool]:
    """Return for each sample whether the arm moved to it from the previous one.

    After a larger step a new path begins.

    Args:
        steps: (m, b) distances that the bodies travelled since the previous sample [m].
    """
    found: list[bool] = (steps.max(axis=1, initial=0.0) <= SAMPLE_M * ROUND).tolist()
    return found


def touching_share(measure: Callable[[float], float], before_m: float, after_m: float, way_m: float) -> float:
    """Return the share of the way at which two bodies touch; negative if no contact is found.

    Args:
        measure: Returns a lower bound of their distance at a share of the way [m]; 0 only if they touch.
        before_m, after_m: The same at the shares 0 and 1.
        way_m: Distance that one body travels relative to the other in all.
    """
    left = [(0.0, 1.0, before_m, after_m)]
    while left:
        first, last, before_m, after_m = left.pop()
        way = (last - first) * way_m
        # To touch in between, the bodies must travel at least the sum of the distances at both ends.
        if before_m + after_m > way * ROUND or way < FINEST_M:
            continue
        middle = (first + last) / 2
        distance = measure(middle)
        if distance == 0.0:
            return middle
        left += [(middle, last, distance, after_m), (first, middle, before_m, distance)]
    return -1.0
