"""What an arm keeps clear of on its way: bodies that stand, and bodies that may be anywhere along a path.

Another robot's way may be as long as a program. It is first looked at in coarse pieces, each line of it once;
only the pieces that are near what the arm itself passes are sampled.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots.collision.cell import Arm, Cell
from robots.collision.distance import Gauge
from robots.collision.geometry import Body, transform
from robots.collision.obstacles import Boxes, boxes_of
from robots.collision.path import (
    SAMPLE_M,
    boxes_of_pieces,
    corners_along,
    pieces_of,
    placements_along,
    sampled_pieces,
)
from robots.joints import FloatArray

# An arm's own path is looked at in so many parts.
_WINDOWS = 8


@dataclass(frozen=True, eq=False)
class Sweep:
    """A body in one place, or in some that it passes one after the other.

    Attributes:
        name: "<robot>/<link>" or "<fixture>".
        placements: (s, 4, 4) to the site [m].
        come: (s,) how far it has come [m].
        box: About all of it; (1, ...).
    """

    name: str
    body: Body
    placements: FloatArray
    come: FloatArray
    box: Boxes
    _transforms: dict[int, Any] = field(default_factory=dict)

    def place(self, number: int) -> Any:
        """A placement as coal has it."""
        found = self._transforms.get(number)
        if found is None:
            found = self._transforms[number] = transform(self.placements[number])
        return found

    @cached_property
    def between_m(self) -> float:
        """Between two places it is no farther than this from one of them."""
        return float(np.diff(self.come).max(initial=0.0)) / 2


@dataclass(frozen=True, eq=False)
class Passed:
    """Boxes along the site's axes that hold all that an arm's moving bodies pass [m].

    Attributes:
        low, high: (w, 3).
    """

    low: FloatArray
    high: FloatArray

    def near(self, low: FloatArray, high: FloatArray, within_m: float) -> NDArray[np.bool_]:
        """Which of some boxes (..., 3) come this near: (...)."""
        found = np.zeros(low.shape[:-1], dtype=np.bool_)
        for own_low, own_high in zip(self.low, self.high, strict=True):
            gaps = np.maximum(np.maximum(low - own_high, own_low - high), 0.0)
            found |= (gaps * gaps).sum(axis=-1) <= within_m**2
        return found


def passed_along(arm: Arm, placements: FloatArray) -> Passed:
    """What an arm's moving bodies pass.

    Args:
        placements: (m, bodies, 4, 4) at samples of its path, to the site [m].
    """
    corners = corners_along(arm.bodies, placements)[:, arm.moving]
    parts = [part for part in np.array_split(corners, _WINDOWS) if len(part)]
    low = np.concatenate([part.min(axis=(0, 2)) for part in parts])
    high = np.concatenate([part.max(axis=(0, 2)) for part in parts])
    # What is between two samples is no farther from one of them than this.
    return Passed(low - SAMPLE_M, high + SAMPLE_M)


def sweeps_of(
    cell: Cell, robot: str, others: Mapping[str, FloatArray], *, passed: Passed, within_m: float
) -> list[Sweep]:
    """The fixtures of a cell, and what the other robots sweep.

    Args:
        others: As `near_along`.
        passed: By the arm that is checked.
        within_m: What comes no nearer to that is left out, if it moves.
    """
    found = []
    standing = cell.fixtures
    for name, body, placement in zip(standing.names, standing.bodies, standing.placements, strict=True):
        found.append(_standing(name, body, placement))
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
            _standing(name, body, place)
            for name, body, place, moves in zip(arm.names, arm.bodies, places, arm.moving, strict=True)
            if not (moves and lines)
        ]
        if lines:
            found += _swept(arm, np.array([*lines.values()]), passed, within_m)
    return found


def _standing(name: str, body: Body, placement: FloatArray) -> Sweep:
    return Sweep(name, body, placement[None], np.zeros(1), boxes_of([body], placement[None]))


def _swept(arm: Arm, lines: FloatArray, passed: Passed, within_m: float) -> list[Sweep]:
    """What an arm's moving bodies sweep on (k, 2, n) straight lines."""
    pieces = pieces_of(lines)
    low, high = boxes_of_pieces(arm, pieces)
    near = passed.near(low, high, within_m) & arm.moving
    wanted = np.flatnonzero(near.any(axis=1))
    centers, halves = (low + high) / 2, (high - low) / 2
    found = []
    sampled = sampled_pieces(arm, pieces[wanted])
    for piece, (placements, come) in zip(wanted.tolist(), sampled, strict=True):
        for number in np.flatnonzero(near[piece]).tolist():
            box = Boxes(centers[piece, number][None], np.eye(3)[None], halves[piece, number][None])
            places, way = placements[:, number], come[:, number]
            found.append(Sweep(arm.names[number], arm.bodies[number], places, way, box))
    return found


def least_of_sweep(gauge: Gauge, body: Body, at: Any, sweep: Sweep, cutoff_m: float) -> tuple[float, int]:
    """The distance of a body to a sweep [m], and the number of the nearest place.

    Only one that is no more than `cutoff_m` is exact; a greater one says that no place is nearer than it.
    One that is no more than what a sweep's places leave out between them counts as touching.

    Args:
        at: The body's placement as coal has it.
    """
    between = sweep.between_m
    least = _least(gauge, body, at, sweep, 0, len(sweep.come), max(cutoff_m, between))
    return (0.0, least[1]) if least[0] <= between else least


def _least(
    gauge: Gauge, body: Body, at: Any, sweep: Sweep, first: int, end: int, cutoff_m: float
) -> tuple[float, int]:
    middle = (first + end) // 2
    distance = gauge.distance(body, at, sweep.body, sweep.place(middle))
    if end - first == 1:
        return distance, middle
    come = sweep.come
    spread = max(float(come[end - 1] - come[middle]), float(come[middle] - come[first]))
    if distance - spread > cutoff_m:
        return distance - spread, middle
    least = distance, middle
    for part in ((first, middle), (middle + 1, end)):
        if part[0] < part[1]:
            least = min(least, _least(gauge, body, at, sweep, *part, min(cutoff_m, least[0])))
    return least
