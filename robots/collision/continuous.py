"""How near an arm gets, along a whole path, to itself and to what stands around it.

Two that are a distance apart cannot touch before they have come that far: at most samples of a path most
pairs need no measuring, and yet nothing is left out. Where two may have met between one sample and the next,
what is between is looked at too.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from heapq import heapreplace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.cells import FLOOR, Floor
from robots.collision.cell import Arm, Cell
from robots.collision.distance import Gauge
from robots.collision.floor import Heights, heights_along
from robots.collision.geometry import TOUCH_M, Body
from robots.collision.interpolated import Placed, touching_share
from robots.collision.obstacles import joined_boxes, least_distances
from robots.collision.path import placements_along, travelled
from robots.collision.swept_volumes import Sweep, least_of_sweep, passed_along, sweeps_of
from robots.joints import FloatArray

# What touches, and what coal's distances may be wrong by [m].
_TOLERANCE_M = 2 * TOUCH_M
_Points = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Encounter:
    """Two that come near each other along a path.

    Attributes:
        pair: Each "<robot>/<link>", "<fixture>" or FLOOR; the arm's own first.
        own: Both are links of the arm.
        samples: (k,) numbers of the path's samples at which they are near, ascending.
        distances: (k,) [m]; 0 where they touch; below the floor negative: so far below.
        points: (k, 2, 3) where they are nearest, on each, in the site's frame [m].
    """

    pair: tuple[str, str]
    own: bool
    samples: NDArray[np.int64]
    distances: FloatArray
    points: FloatArray


@dataclass(frozen=True, eq=False)
class Along:
    """What an arm comes near to along a path.

    Attributes:
        clearances: (m,) distance to what is nearest around at each sample [m]; infinite: nothing is around.
        encounters: One a pair, in the order in which they begin.
    """

    clearances: FloatArray
    encounters: tuple[Encounter, ...]


def near_along(
    cell: Cell,
    robot: str,
    positions: FloatArray,
    others: Mapping[str, FloatArray],
    *,
    within_m: float,
    far: bool = True,
) -> Along:
    """What an arm comes near to along a path: fixtures, other robots, the floor, links of its own.

    Between two samples it may be nearer by half of what it moves there; where it may even touch, and moves
    no more than SAMPLE_M (else a path begins anew there), that is looked for, and told of the second sample.
    What it does not move (its base) is checked against its own links only: its motion changes nothing there.

    Args:
        positions: (m, n) samples of the path, m at least 1 [rad] or [m].
        others: Straight joint path (k, n) of each other robot of the cell that counts, from where it is to
            where it has been told to go (k = 1: it stands); the arm is checked against all of it, whenever.
        within_m: From this distance on two are near; links of its own only when they touch, the floor from
            its own warning distance on.
        far: Whether clearances beyond that are asked for, too; else they may be told as infinite, sooner.
    """
    arm = cell.arms[robot]
    places = placements_along(arm, positions)
    come = travelled(arm.bodies, places)
    gauge = Gauge()
    reach = np.inf if far else within_m + _TOLERANCE_M
    sweeps = sweeps_of(cell, robot, others, passed=passed_along(arm, places), within_m=reach)
    around = _Around(cell, arm, places[0], sweeps, within_m, reach)
    own = _Own(arm, come)
    clearances = np.full(len(positions), np.inf)
    found: dict[tuple[str, str], dict[int, _Near]] = {}
    for sample, row in enumerate(places):
        last = max(sample - 1, 0)
        at = Placed(row, places[last], come[sample] - come[last])
        clearances[sample], near = around.measured(gauge, at, come[sample])
        for each in (*near, *own.measured(gauge, at, sample)):
            found.setdefault(each.pair, {})[sample] = each
    encounters = [_encounter(arm, samples) for samples in found.values()]
    if cell.floor is not None:
        heights = heights_along(cell.floor, arm, positions, places, come)
        encounters += _floored(cell.floor, arm, heights)
        if cell.floor.warning_m > 0.0:
            lowest = heights.heights.min(axis=1, initial=np.inf)
            clearances = np.minimum(clearances, np.maximum(lowest, 0.0))
    return Along(clearances, tuple(encounters))


def _floored(floor: Floor, arm: Arm, found: Heights) -> Iterator[Encounter]:
    """The links that come near the floor or below it."""
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


class _Met(NamedTuple):
    """A body of the arm and the nearest place of a sweep."""

    distance: float
    body: Body
    at: Any
    sweep: Sweep
    place: int


class _Around:
    """Pairs of the arm's bodies and what is around: `_known` less the way come since is no more than a
    pair's distance."""

    def __init__(
        self, cell: Cell, arm: Arm, first: FloatArray, sweeps: list[Sweep], within_m: float, reach_m: float
    ) -> None:
        self._arm, self._sweeps = arm, sweeps
        self._limit, self._reach = within_m + _TOLERANCE_M, reach_m
        # Together: what is told as one pair.
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
            boxes = joined_boxes([sweep.box for sweep in sweeps])
            least = least_distances(arm.balls, first[None], boxes)[0]
            self._known = least[tuple(np.array(self._pairs).T)]

    def measured(self, gauge: Gauge, at: Placed, come: FloatArray) -> tuple[float, list[_Near]]:
        """The least distance of all pairs, and the pairs that are near."""
        nearest = np.inf
        near: list[_Near] = []
        moved = come[self._bodies]
        bounds = self._known - moved
        if not len(bounds):
            return nearest, near
        close = np.flatnonzero(np.minimum.reduceat(bounds, self._starts) < self._limit)
        for names, here in [self._groups[group] for group in close.tolist()]:
            found: _Met | None = None
            # What was nearest at the last sample often is again: its distance spares measuring others.
            number = self._nearest.get(names, here.start)
            if bounds[number] >= self._limit:
                number = here.start + int(bounds[here].argmin())
            while True:
                cutoff = self._limit if found is None else found.distance
                # Nobody is nearer than touching, whatever the bound.
                if max(bounds[number], 0.0) >= cutoff:
                    break
                met = self._measured(gauge, at, number, bounds[number], moved[number], cutoff)
                # Beyond the cutoff it is a bound, too, and may be measured again below.
                bounds[number] = np.inf if met.distance <= cutoff else met.distance
                if met.distance < cutoff:
                    found, self._nearest[names] = met, number
                number = here.start + int(bounds[here].argmin())
            if found is not None:
                nearest = min(nearest, found.distance)
                near.append(_Near(names, found.distance, self._points(gauge, found)))
        while True:
            number = int(bounds.argmin())
            cutoff = min(nearest, self._reach)
            if max(bounds[number], 0.0) >= cutoff:
                break
            met = self._measured(gauge, at, number, bounds[number], moved[number], cutoff)
            bounds[number] = np.inf
            nearest = min(nearest, met.distance)
        return (nearest if nearest <= self._reach else np.inf), near

    def _measured(
        self, gauge: Gauge, at: Placed, number: int, bound: float, moved: float, cutoff_m: float
    ) -> _Met:
        """How near a pair is; exact, or more than the cutoff.

        Args:
            bound: What the pair's distance is no less than.
            moved: The way that the arm's body has come.
        """
        one, other = self._pairs[number]
        body, sweep = self._arm.bodies[one], self._sweeps[other]
        distance, place = least_of_sweep(gauge, body, at[one], sweep, cutoff_m)
        self._known[number] = distance + moved
        step = float(at.steps[one])
        before = bound + step
        if at.joined and before > TOUCH_M and 0.0 < distance < step:

            def measure(share: float) -> float:
                return least_of_sweep(gauge, body, at.on_the_way(one, share), sweep, step)[0]

            share = touching_share(measure, before, distance, step)
            if share >= 0.0:
                there = at.on_the_way(one, share)
                return _Met(0.0, body, there, sweep, least_of_sweep(gauge, body, there, sweep, 0.0)[1])
        return _Met(distance, body, at[one], sweep, place)

    def _points(self, gauge: Gauge, met: _Met) -> _Points:
        there = met.sweep.place(met.place)
        gauge.distance(met.body, met.at, met.sweep.body, there)
        return gauge.points(met.body, met.at, met.sweep.body, there)


class _Own:
    """Pairs of the arm's own bodies; near is what touches. Each is measured when it may touch again."""

    def __init__(self, arm: Arm, come: FloatArray) -> None:
        self._arm = arm
        ones, others = np.array(arm.own.pairs, dtype=np.int64).reshape(-1, 2).T
        self._ways = np.ascontiguousarray((come[:, ones] + come[:, others]).T)
        self._due = [(0, number) for number in range(len(ones))]  # a heap, by sample
        # Less the way come since, each is no more than a pair's distance.
        self._known = np.zeros(len(ones))

    def measured(self, gauge: Gauge, at: Placed, sample: int) -> Iterator[_Near]:
        """The pairs that touch."""
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
                share = self._met(gauge, at, number, before, distance)
                if share >= 0.0:
                    there = at.on_the_way(one, share), at.on_the_way(other, share)
                    distance = self._distance(gauge, *there, number)
            if distance == 0.0:
                bodies = self._arm.own.measured[number]
                points = gauge.points(bodies[0], there[0], bodies[1], there[1])
                yield _Near((names[one], names[other]), distance, points)

    def _distance(self, gauge: Gauge, one_at: Any, other_at: Any, number: int) -> float:
        one, other = self._arm.own.measured[number]
        return gauge.bound(one, one_at, other, other_at)

    def _met(self, gauge: Gauge, at: Placed, number: int, before_m: float, after_m: float) -> float:
        """As `_Around._met`."""
        one, other = self._arm.own.pairs[number]

        def measure(share: float) -> float:
            return self._distance(gauge, at.on_the_way(one, share), at.on_the_way(other, share), number)

        # Of two that go along together, the one hardly moves as the other sees it.
        return touching_share(
            measure, before_m, after_m, at.way(one, other, self._arm.own.measured[number][1])
        )
