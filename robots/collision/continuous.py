"""Clearances of an arm to itself and to the obstacles around it, on a whole path.

Two bodies cannot touch before they have travelled the distance between them. So most pairs need no
measurement at most samples, and no contact is missed. If two bodies may have touched between two samples, the
interval is searched too.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from heapq import heapreplace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bodies.geometry import TOUCH_M, Body
from robots.collision.bisection import Placed, joined, touching_share
from robots.collision.cell import Arm, Cell
from robots.collision.distance import Gauge
from robots.collision.floor import Heights, heights_on_path
from robots.collision.obstacles import join_boxes, least_distances
from robots.collision.path import placements_along, travelled
from robots.collision.swept_volumes import Sweep, distance_to_sweep, sweeps_of
from robots.descriptions.cells import FLOOR, Floor
from robots.kinematics.joints import FloatArray

# Distance at which bodies touch, and the error of coal's distances [m].
_TOLERANCE_M = 2 * TOUCH_M
_Points = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Encounter:
    """Two bodies that come near each other on a path.

    Attributes:
        pair: The bodies: "<robot>/<link>", "<fixture>" or FLOOR; the arm's link first.
        own: Whether both are links of the arm.
        samples: (k,) numbers of the path's samples at which they are near, ascending.
        distances: (k,) [m]; 0 if they touch; negative below the floor.
        points: (k, 2, 3) the nearest point on each, in the site's frame [m].
    """

    pair: tuple[str, str]
    own: bool
    samples: NDArray[np.int64]
    distances: FloatArray
    points: FloatArray


@dataclass(frozen=True, eq=False)
class PathEncounters:
    """Clearances and encounters of an arm on a path.

    Attributes:
        clearances: (m,) distance to the nearest obstacle at each sample [m]; infinite without obstacles.
        encounters: One per pair, in the order of their first samples.
    """

    clearances: FloatArray
    encounters: tuple[Encounter, ...]


def path_encounters(
    cell: Cell,
    robot: str,
    positions: FloatArray,
    others: Mapping[str, FloatArray],
    *,
    within_m: float,
    far: bool = True,
) -> PathEncounters:
    """Find the fixtures, other robots, floor and own links that an arm comes near to on a path.

    Between two samples, a distance may be smaller by half of the arm's travel there. If two bodies may touch
    there, the interval is searched, and a contact is reported at the second sample. It is not searched if the
    arm travels more than SAMPLE_M, because then a new path begins. The arm's base is checked only against its
    own links.

    Args:
        positions: (m, n) samples of the path, m at least 1 [rad] or [m].
        others: Straight joint path (k, n) of each other robot to check against, from its position to its
            commanded target (k = 1: it does not move). The arm is checked against all of it at any time.
        within_m: Pairs within this distance are near. The arm's own links are near only if they touch; the
            floor has its own warning distance.
        far: Return exact clearances beyond `within_m` too; otherwise they may be infinite, which is faster.
    """
    arm = cell.arms[robot]
    places = placements_along(arm, positions)
    travel = travelled(arm.bodies, places)
    gauge = Gauge()
    reach = np.inf if far else within_m + _TOLERANCE_M
    sweeps = sweeps_of(cell, robot, others, placements=places, within_m=reach)
    outside = _OutsidePairs(cell, arm, places[0], sweeps, within_m, reach)
    own = _SelfPairs(arm, travel)
    clearances = np.full(len(positions), np.inf)
    found: dict[tuple[str, str], dict[int, _Near]] = {}
    steps = np.diff(travel, axis=0, prepend=travel[:1])
    before = places[0]
    for sample, (row, is_joined) in enumerate(zip(places, joined(steps), strict=True)):
        at = Placed(row, before, steps[sample], joined=is_joined)
        before = row
        clearances[sample], near = outside.measured(gauge, at, travel[sample])
        for each in (*near, *own.measured(gauge, at, sample)):
            found.setdefault(each.pair, {})[sample] = each
    encounters = [_encounter(arm, samples) for samples in found.values()]
    if cell.floor is not None:
        heights = heights_on_path(cell.floor, arm, positions, places, travel)
        encounters += _floor_encounters(cell.floor, arm, heights)
        if cell.floor.warning_m > 0.0:
            lowest = heights.heights.min(axis=1, initial=np.inf)
            clearances = np.minimum(clearances, np.maximum(lowest, 0.0))
    return PathEncounters(clearances, tuple(encounters))


def _floor_encounters(floor: Floor, arm: Arm, found: Heights) -> Iterator[Encounter]:
    """Yield the encounters of links near or below the floor."""
    names = [arm.names[number] for number in found.bodies.tolist()]
    for name in dict.fromkeys(names):
        columns = [column for column, each in enumerate(names) if each == name]
        heights = found.heights[:, columns]
        lowest = heights.argmin(axis=1)
        least = heights.min(axis=1)
        near = np.flatnonzero((least <= 0.0) | (least < floor.warning_m))
        if len(near):
            points = found.points[near, np.array(columns)[lowest[near]]]
            below = points.copy()
            below[:, 2] = floor.height_m
            yield Encounter((name, FLOOR), False, near, least[near], np.stack([points, below], axis=1))


def _encounter(arm: Arm, samples: Mapping[int, "_Near"]) -> Encounter:
    near = list(samples.values())
    return Encounter(
        pair=near[0].pair,
        own=near[0].pair[1] in arm.names,
        samples=np.array(list(samples), dtype=np.int64),
        distances=np.array([each.distance for each in near]),
        points=np.array([each.points for each in near]),
    )


class _Near(NamedTuple):
    pair: tuple[str, str]
    distance: float
    points: _Points


class _Measured(NamedTuple):
    """A body of the arm and the nearest placement of a sweep."""

    distance: float
    body: Body
    at: Any
    sweep: Sweep
    place: int


class _OutsidePairs:
    """Pairs of the arm's bodies and the sweeps around it.

    `_known` less the body's travelled distance is a lower bound of each pair's distance.
    """

    def __init__(
        self, cell: Cell, arm: Arm, first: FloatArray, sweeps: list[Sweep], within_m: float, reach_m: float
    ) -> None:
        self._arm, self._sweeps = arm, sweeps
        self._limit, self._reach = within_m + _TOLERANCE_M, reach_m
        # Body and sweep numbers of each named pair, which is reported as one.
        together: dict[tuple[str, str], list[tuple[int, int]]] = {}
        for one in np.flatnonzero(arm.moving).tolist():
            for other, sweep in enumerate(sweeps):
                names = arm.names[one], sweep.name
                if names not in cell.ignored:
                    together.setdefault(names, []).append((one, other))
        self._pairs = [pair for pairs in together.values() for pair in pairs]
        ends = np.cumsum([0, *map(len, together.values())]).tolist()
        self._groups = [(names, slice(*ends[i : i + 2])) for i, names in enumerate(together)]
        self._starts = ends[:-1]
        self._nearest: dict[tuple[str, str], int] = {}
        self._bodies = np.array([one for one, _ in self._pairs], dtype=np.int64)
        self._known = np.empty(0)
        if self._pairs:
            boxes = join_boxes([sweep.box for sweep in sweeps])
            least = least_distances(arm.balls, first, boxes)
            self._known = least[tuple(np.array(self._pairs).T)]

    def measured(self, gauge: Gauge, at: Placed, travel: FloatArray) -> tuple[float, list[_Near]]:
        """Return the least distance of all pairs, and the pairs that are near."""
        nearest = np.inf
        near: list[_Near] = []
        if not self._pairs:
            return nearest, near
        bounds = self._known - travel.take(self._bodies)
        lowest = int(bounds.argmin())
        close: list[int] = []
        if bounds[lowest] < self._limit:
            close = np.flatnonzero(np.minimum.reduceat(bounds, self._starts) < self._limit).tolist()
        for names, here in [self._groups[group] for group in close]:
            found: _Measured | None = None
            # Start with the nearest of the last sample: it often is the nearest again, so that others need no
            # measurement.
            number = self._nearest.get(names, here.start)
            if bounds[number] >= self._limit:
                number = here.start + int(bounds[here].argmin())
            while True:
                cutoff = self._limit if found is None else found.distance
                # A bound may be negative, a distance may not.
                if max(bounds[number], 0.0) >= cutoff:
                    break
                measured = self._measured(gauge, at, number, bounds[number], travel, cutoff)
                # Beyond the cutoff, the distance is another bound and may be measured again below.
                bounds[number] = np.inf if measured.distance <= cutoff else measured.distance
                if measured.distance < cutoff:
                    found, self._nearest[names] = measured, number
                number = here.start + int(bounds[here].argmin())
            if found is not None:
                nearest = min(nearest, found.distance)
                near.append(_Near(names, found.distance, self._points(gauge, found)))
        number = int(bounds.argmin()) if close else lowest
        while max(bounds[number], 0.0) < (cutoff := min(nearest, self._reach)):
            measured = self._measured(gauge, at, number, bounds[number], travel, cutoff)
            bounds[number] = np.inf
            nearest = min(nearest, measured.distance)
            number = int(bounds.argmin())
        return (nearest if nearest <= self._reach else np.inf), near

    def _measured(
        self, gauge: Gauge, at: Placed, number: int, bound: float, travel: FloatArray, cutoff_m: float
    ) -> _Measured:
        """Measure a pair; the distance is exact up to the cutoff, and a lower bound beyond.

        Args:
            bound: Lower bound of the pair's distance.
            travel: (b,) distances that the arm's bodies have travelled [m].
        """
        one, other = self._pairs[number]
        body, sweep = self._arm.bodies[one], self._sweeps[other]
        distance, place = distance_to_sweep(gauge, body, at[one], sweep, cutoff_m)
        self._known[number] = distance + travel[one]
        step = float(at.steps[one])
        before = bound + step
        if at.joined and before > TOUCH_M and 0.0 < distance < step:

            def measure(share: float) -> float:
                return distance_to_sweep(gauge, body, at.interpolated(one, share), sweep, step)[0]

            share = touching_share(measure, before, distance, step)
            if share >= 0.0:
                there = at.interpolated(one, share)
                return _Measured(
                    0.0, body, there, sweep, distance_to_sweep(gauge, body, there, sweep, 0.0)[1]
                )
        return _Measured(distance, body, at[one], sweep, place)

    def _points(self, gauge: Gauge, measured: _Measured) -> _Points:
        there = measured.sweep.place(measured.place)
        gauge.distance(measured.body, measured.at, measured.sweep.body, there)
        return gauge.points(measured.body, measured.at, measured.sweep.body, there)


class _SelfPairs:
    """Pairs of the arm's own bodies, near if they touch. Each is measured when it may touch again."""

    def __init__(self, arm: Arm, travel: FloatArray) -> None:
        self._arm = arm
        ones, others = np.array(arm.own.pairs, dtype=np.int64).reshape(-1, 2).T
        self._ways = np.ascontiguousarray((travel[:, ones] + travel[:, others]).T)
        self._due = [(0, number) for number in range(len(ones))]  # a heap, by sample
        # Less the travelled distance, each is a lower bound of a pair's distance.
        self._known = np.zeros(len(ones))

    def measured(self, gauge: Gauge, at: Placed, sample: int) -> Iterator[_Near]:
        """Yield the pairs that touch."""
        names = self._arm.names
        while self._due and self._due[0][0] <= sample:
            number = self._due[0][1]
            one, other = self._arm.own.pairs[number]
            distance = self._distance(gauge, at[one], at[other], number)
            way = self._ways[number]
            before = self._known[number] - way[sample - 1] if sample else 0.0
            self._known[number] = distance + way[sample]
            due = int(way.searchsorted(way[sample] + distance - _TOLERANCE_M))
            heapreplace(self._due, (max(due, sample + 1), number))
            there = at[one], at[other]
            if at.joined and before > TOUCH_M and 0.0 < distance < at.steps[one] + at.steps[other]:
                share = self._touching_share(gauge, at, number, before, distance)
                if share >= 0.0:
                    there = at.interpolated(one, share), at.interpolated(other, share)
                    distance = self._distance(gauge, *there, number)
            if distance == 0.0:
                bodies = self._arm.own.measured[number]
                points = gauge.points(bodies[0], there[0], bodies[1], there[1])
                yield _Near((names[one], names[other]), distance, points)

    def _distance(self, gauge: Gauge, one_at: Any, other_at: Any, number: int) -> float:
        one, other = self._arm.own.measured[number]
        return gauge.bound(one, one_at, other, other_at)

    def _touching_share(
        self, gauge: Gauge, at: Placed, number: int, before_m: float, after_m: float
    ) -> float:
        """Return the `touching_share` of a pair between the previous sample and this one."""
        one, other = self._arm.own.pairs[number]

        def measure(share: float) -> float:
            return self._distance(gauge, at.interpolated(one, share), at.interpolated(other, share), number)

        # Use the relative travel: it is small for two bodies that move together.
        return touching_share(
            measure, before_m, after_m, at.way(one, other, self._arm.own.measured[number][1])
        )
