"""How high an arm's bodies are above the floor: exact, by the lowest corner of each."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robots.cells import Floor
from robots.collision.cell import Arm
from robots.collision.geometry import TOUCH_M
from robots.collision.interpolated import ROUND
from robots.collision.path import SAMPLE_M, placements_along
from robots.joints import FloatArray

# So many samples are looked at together.
_TOGETHER = 500
# Between two samples a body that turns may dip: it is looked at there, too, each millimetre of its way.
_BETWEEN = np.linspace(0.0, 1.0, 6)[1:-1]


@dataclass(frozen=True, eq=False)
class Heights:
    """How high the moving bodies of an arm are above the floor, at samples.

    Attributes:
        bodies: (k,) numbers of the arm's bodies that a joint moves.
        heights: (m, k) of the lowest point of each [m]; 0 or less: it is below the floor so far.
        points: (m, k, 3) that point, in the site's frame [m].
    """

    bodies: NDArray[np.int64]
    heights: FloatArray
    points: FloatArray


def heights_above(
    floor: Floor, arm: Arm, placements: FloatArray, bodies: NDArray[np.int64] | None = None
) -> Heights:
    """How high an arm's moving bodies are above a floor.

    Args:
        placements: (m, bodies, 4, 4) of the arm's bodies to the site [m].
        bodies: Numbers of those that are asked for; None: all that a joint moves.
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
    # What stands on the floor does not touch it.
    return Heights(numbers, points[..., 2] - (floor.height_m - TOUCH_M), points)


def heights_along(
    floor: Floor, arm: Arm, positions: FloatArray, placements: FloatArray, come: FloatArray
) -> Heights:
    """As `heights_above` along a path; a touch between two samples is told of the second one.

    Args:
        positions: (m, n) samples of the path [rad] or [m].
        placements: (m, bodies, 4, 4) of the arm's bodies there.
        come: (m, bodies) how far each has come [m].
    """
    found = heights_above(floor, arm, placements)
    low = (found.heights > 0.0) & (found.heights < SAMPLE_M / 2)
    # What turns about an upright axis keeps its height.
    low &= np.ptp(placements[:, found.bodies, 2, :], axis=0).max(axis=1) > 0.0
    # A larger jump between two samples starts a new path.
    steps = np.diff(come, axis=0).max(axis=1, initial=0.0)
    dips = (low[:-1] | low[1:]) & (found.heights[1:] > 0.0)
    dips[(steps == 0.0) | (steps > SAMPLE_M * ROUND)] = False
    rows = np.flatnonzero(dips.any(axis=1)) + 1
    columns = np.flatnonzero(dips.any(axis=0))
    for begin in range(0, len(rows), _TOGETHER):
        samples = rows[begin : begin + _TOGETHER]
        before, now = positions[samples - 1, None], positions[samples, None]
        between = (before + _BETWEEN[:, None] * (now - before)).reshape(-1, positions.shape[1])
        met = heights_above(floor, arm, placements_along(arm, between), found.bodies[columns])
        heights = met.heights.reshape(len(samples), len(_BETWEEN), -1)
        points = met.points.reshape(*heights.shape, 3)
        lowest = heights.argmin(axis=1)[:, None]
        heights = np.take_along_axis(heights, lowest, axis=1)[:, 0]
        points = np.take_along_axis(points, lowest[..., None], axis=1)[:, 0]
        here = np.ix_(samples, columns)
        touches = dips[np.ix_(samples - 1, columns)] & (heights <= 0.0)
        found.heights[here] = np.where(touches, heights, found.heights[here])
        found.points[here] = np.where(touches[..., None], points, found.points[here])
    return found


def floor_advice(floor: Floor, lowest_m: float) -> str:
    """What to write where the floor is not where an arm has to go.

    Args:
        lowest_m: How low it goes, in the site's frame.
    """
    assert floor.height_m is not None
    # Whole centimetres, and not above what the arm needs.
    below_mm = math.floor(round(lowest_m * 1000 - 0.5, 3) / 10) * 10
    return (
        f"if the floor is lower than {floor.height_m * 1000:g} mm, write floor = {below_mm}.0 for the robot "
        "in the site file; if there is none, floor = false"
    )
