"""Heights of an arm's bodies above the floor: exact, from the lowest corner of each body."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.bodies.geometry import TOUCH_M
from robots.collision.bisection import ROUND
from robots.collision.cell import Arm
from robots.collision.path import SAMPLE_M, placements_along
from robots.descriptions.cells import Floor
from robots.kinematics.joints import FloatArray

# Samples per batch.
_TOGETHER = 500
# A rotating body may dip between two samples: it is checked there too, after each millimetre of its way.
_BETWEEN = np.linspace(0.0, 1.0, 6)[1:-1]


@dataclass(frozen=True, eq=False)
class Heights:
    """Heights of an arm's moving bodies above the floor, at samples.

    Attributes:
        bodies: (k,) numbers of the bodies.
        heights: (m, k) height of each body's lowest point [m]; 0 or negative if it is below the floor.
        points: (m, k, 3) the lowest points, in the site's frame [m].
    """

    bodies: NDArray[np.int64]
    heights: FloatArray
    points: FloatArray


def heights_above(
    floor: Floor, arm: Arm, placements: FloatArray, bodies: NDArray[np.int64] | None = None
) -> Heights:
    """Return the heights of an arm's bodies above a floor.

    Args:
        placements: (m, bodies, 4, 4) of the arm's bodies to the site [m].
        bodies: Numbers of the bodies to measure; None: all moving bodies.
    """
    assert floor.height_m is not None
    numbers = np.flatnonzero(arm.moving) if bodies is None else bodies
    points = np.empty((len(placements), len(numbers), 3))
    for column, number in enumerate(numbers.tolist()):
        corners = arm.bodies[number].corners
        for begin in range(0, len(placements), _TOGETHER):
            rows = slice(begin, begin + _TOGETHER)
            places = placements[rows, number]
            lowest = corners[(places[:, 2, :3] @ corners.T).argmin(axis=1)]
            points[rows, column] = np.einsum("mij,mj->mi", places[:, :3, :3], lowest) + places[:, :3, 3]
    # An arm that rests on the floor does not collide with it.
    return Heights(numbers, points[..., 2] - (floor.height_m - TOUCH_M), points)


def heights_on_path(
    floor: Floor, arm: Arm, positions: FloatArray, placements: FloatArray, travel: FloatArray
) -> Heights:
    """Return the heights of an arm's moving bodies on a path, with contacts between samples.

    A contact between two samples is reported at the second one.

    Args:
        positions: (m, n) samples of the path [rad] or [m].
        placements: (m, bodies, 4, 4) of the arm's bodies there.
        travel: (m, bodies) distance that each body has travelled [m].
    """
    found = heights_above(floor, arm, placements)
    low = (found.heights > 0.0) & (found.heights < SAMPLE_M / 2)
    # A body that rotates about a vertical axis keeps its height.
    low &= np.ptp(placements[:, found.bodies, 2, :], axis=0).max(axis=1) > 0.0
    # A larger step between two samples starts a new path.
    steps = np.diff(travel, axis=0).max(axis=1, initial=0.0)
    dips = (low[:-1] | low[1:]) & (found.heights[1:] > 0.0)
    dips[(steps == 0.0) | (steps > SAMPLE_M * ROUND)] = False
    rows = np.flatnonzero(dips.any(axis=1)) + 1
    columns = np.flatnonzero(dips.any(axis=0))
    for begin in range(0, len(rows), _TOGETHER):
        samples = rows[begin : begin + _TOGETHER]
        before, now = positions[samples - 1, None], positions[samples, None]
        between = (before + _BETWEEN[:, None] * (now - before)).reshape(-1, positions.shape[1])
        measured = heights_above(floor, arm, placements_along(arm, between), found.bodies[columns])
        heights = measured.heights.reshape(len(samples), len(_BETWEEN), -1)
        points = measured.points.reshape(*heights.shape, 3)
        lowest = heights.argmin(axis=1)[:, None]
        heights = np.take_along_axis(heights, lowest, axis=1)[:, 0]
        points = np.take_along_axis(points, lowest[..., None], axis=1)[:, 0]
        here = np.ix_(samples, columns)
        touches = dips[np.ix_(samples - 1, columns)] & (heights <= 0.0)
        found.heights[here] = np.where(touches, heights, found.heights[here])
        found.points[here] = np.where(touches[..., None], points, found.points[here])
    return found


def floor_advice(floor: Floor, lowest_m: float) -> Reason:
    """Return advice on the site file's floor for an arm that has to go below it.

    Args:
        lowest_m: Lowest height of the arm, in the site's frame.
    """
    assert floor.height_m is not None
    # Whole centimetres, rounded down.
    below_mm = math.floor(round(lowest_m * 1000 - 0.5, 3) / 10) * 10
    return codes.FLOOR_ADVICE(height_mm=floor.height_m * 1000, below_mm=below_mm)
