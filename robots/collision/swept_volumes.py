"""Obstacles on an arm's path: bodies at rest, and bodies that may be anywhere on a path of their robot.

Another robot's path may be as long as a program. It is cut into coarse pieces, each line once, and only the
pieces near the volume that the checked arm sweeps are sampled.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots.bodies.geometry import Body, transform
from robots.collision.cell import Arm, Cell
from robots.collision.distance import Gauge
from robots.collision.obstacles import Boxes, bounds_of, placed_boxes
from robots.collision.path import (
    SAMPLE_M,
    boxes_of_pieces,
    corners_along,
    pieces_of,
    placements_along,
    sampled_pieces,
)
from robots.kinematics.joints import FloatArray

# Number of boxes for the volume that an arm sweeps.
_WINDOWS = 8


@dataclass(frozen=True, eq=False)
class Sweep:
    """A body at rest, or at consecutive samples of a path.

    Attributes:
        name: "<robot>/<link>" or "<fixture>".
        placements: (s, 4, 4) to the site [m].
        travel: (s,) distance that the body has travelled [m].
        box: Bounding box of the sweep; (1, ...).
    """

    name: str
    body: Body
    placements: FloatArray
    travel: FloatArray
    box: Boxes
    _transforms: dict[int, Any] = field(default_factory=dict)

    def place(self, number: int) -> Any:
        """Return coal's form of a placement."""
        found = self._transforms.get(number)
        if found is None:
            found = self._transforms[number] = transform(self.placements[number])
        return found

    @cached_property
    def between_m(self) -> float:
        """Largest distance of the body, between two samples, from the nearer of them [m]."""
        return float(np.diff(self.travel).max(initial=0.0)) / 2


@dataclass(frozen=True, eq=False)
class SweptRegion:
    """Boxes along the site's axes that contain the volume that an arm's moving bodies sweep [m].

    Attributes:
        low, high: (w, 3).
    """

    low: FloatArray
    high: FloatArray

    def near(self, low: FloatArray, high: FloatArray, within_m: float) -> NDArray[np.bool_]:
        """Return which of the boxes (..., 3) are within a distance: (...)."""
        found = np.zeros(low.shape[:-1], dtype=np.bool_)
        for own_low, own_high in zip(self.low, self.high, strict=True):
            gaps = np.maximum(np.maximum(low - own_high, own_low - high), 0.0)
            found |= (gaps * gaps).sum(axis=-1) <= within_m**2
        return found


def swept_region(arm: Arm, placements: FloatArray) -> SweptRegion:
    """Return the boxes that an arm's moving bodies sweep.

    Args:
        placements: (m, bodies, 4, 4) at samples of the arm's path, to the site [m].
    """
    corners = corners_along(arm.bodies, placements)[:, arm.moving]
    parts = [part for part in np.array_split(corners, _WINDOWS) if len(part)]
    low = np.concatenate([part.min(axis=(0, 2)) for part in parts])
    high = np.concatenate([part.max(axis=(0, 2)) for part in parts])
    # Between two samples, a body is within this distance of one of them.
    return SweptRegion(low - SAMPLE_M, high + SAMPLE_M)


def sweeps_of(
    cell: Cell, robot: str, others: Mapping[str, FloatArray], *, placements: FloatArray, within_m: float
) -> list[Sweep]:
    """Return the sweeps of a cell's fixtures and of the other robots.

    Args:
        others: See `path_encounters`.
        placements: (m, bodies, 4, 4) at samples of the checked arm's path, to the site [m].
        within_m: Leave out moving bodies that are farther than this from what the checked arm sweeps.
    """
    found = []
    passed: SweptRegion | None = None
    fixtures = cell.fixtures
    for name, body, placement in zip(fixtures.names, fixtures.bodies, fixtures.placements, strict=True):
        found.append(_at_rest(name, body, placement))
    for other, path in others.items():
        if other == robot:
            continue
        arm = cell.arms[other]
        lines = {
            tuple(sorted((start.tobytes(), end.tobytes()))): (start, end) for start, end in pairwise(path)
        }
        lines = {key: line for key, line in lines.items() if key[0] != key[1]}
        (places,) = placements_along(arm, path[:1])
        found += [
            _at_rest(name, body, place)
            for name, body, place, moves in zip(arm.names, arm.bodies, places, arm.moving, strict=True)
            if not (moves and lines)
        ]
        if lines:
            passed = passed or swept_region(cell.arms[robot], placements)
            found += _swept(arm, np.array([*lines.values()]), passed, within_m)
    return found


def _at_rest(name: str, body: Body, placement: FloatArray) -> Sweep:
    return Sweep(name, body, placement[None], np.zeros(1), placed_boxes(bounds_of([body]), placement[None]))


def _swept(arm: Arm, lines: FloatArray, passed: SweptRegion, within_m: float) -> list[Sweep]:
    """Return the sweeps of an arm's moving bodies on (k, 2, n) straight lines."""
    pieces = pieces_of(lines)
    low, high = boxes_of_pieces(arm, pieces)
    near = passed.near(low, high, within_m) & arm.moving
    wanted = np.flatnonzero(near.any(axis=1))
    centers, halves = (low + high) / 2, (high - low) / 2
    found = []
    sampled = sampled_pieces(arm, pieces[wanted])
    for piece, (placements, travel) in zip(wanted.tolist(), sampled, strict=True):
        for number in np.flatnonzero(near[piece]).tolist():
            box = Boxes(centers[piece, number][None], np.eye(3)[None], halves[piece, number][None])
            places, way = placements[:, number], travel[:, number]
            found.append(Sweep(arm.names[number], arm.bodies[number], places, way, box))
    return found


def distance_to_sweep(gauge: Gauge, body: Body, at: Any, sweep: Sweep, cutoff_m: float) -> tuple[float, int]:
    """Return the distance of a body to a sweep [m], and the number of the nearest placement.

    The distance is exact up to `cutoff_m`; a larger value is a lower bound. A distance up to the sweep's
    `between_m` counts as contact.

    Args:
        at: Coal's form of the body's placement.
    """
    if len(sweep.travel) == 1:
        return gauge.distance(body, at, sweep.body, sweep.place(0)), 0
    between = sweep.between_m
    least = _least(gauge, body, at, sweep, 0, len(sweep.travel), max(cutoff_m, between))
    return (0.0, least[1]) if least[0] <= between else least


def _least(
    gauge: Gauge, body: Body, at: Any, sweep: Sweep, first: int, end: int, cutoff_m: float
) -> tuple[float, int]:
    middle = (first + end) // 2
    distance = gauge.distance(body, at, sweep.body, sweep.place(middle))
    if end - first == 1:
        return distance, middle
    travel = sweep.travel
    spread = max(float(travel[end - 1] - travel[middle]), float(travel[middle] - travel[first]))
    if distance - spread > cutoff_m:
        return distance - spread, middle
    least = distance, middle
    for part in ((first, middle), (middle + 1, end)):
        if part[0] < part[1]:
            least = min(least, _least(gauge, body, at, sweep, *part, min(cutoff_m, least[0])))
    return least
