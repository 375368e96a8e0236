"""What is met on straight joint motions, however fast they are made: each is looked at once."""

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import TypeAlias

import numpy as np

from robomesh.reasons import Reason
from robots.collision import Cell, distances
from robots.collision.continuous import Encounter, near_along
from robots.joints import FloatArray, violations
from robots.programs.steps import Step, ViolationKind
from robots.programs.tool_chain import samples_between, tool_chain, tools_and_jacobians
from robots.singularity import singularity_margins

# Along a line of the tool the arm is to be no nearer to a singular position: the smallest singular value of
# the tool's Jacobian, lengths counted in the arm's reach.
SINGULAR = 0.02

# Motions are looked at together up to so many samples: what is far away then is measured once for many.
_TOGETHER = 4_000
# Samples of motions that are kept, should they come again.
_KEPT = 100_000
# Where a target is far beyond its limits, nobody goes: so many samples show enough.
_MOST_BEYOND = 500
# A stretch's start and target, to the last bit, and whether it is part of a line.
_Key: TypeAlias = tuple[bytes, bytes, bool]


@dataclass(frozen=True, eq=False)
class Finding:
    """Something met at a sample.

    Attributes:
        kind: COLLISION, CLEARANCE or SINGULARITY.
        pair: That it is about; empty for none.
        value: How bad it is, the smaller the worse: a distance [m], negative below the floor, or a margin.
        limit: What it should not be below.
        points: (k, 3) in the site's frame [m].
        stops: Whether the motion is refused for it.
    """

    kind: ViolationKind
    pair: tuple[str, ...]
    value: float
    limit: float
    points: FloatArray
    stops: bool = True


@dataclass(frozen=True, eq=False)
class Stretch:
    """A straight joint motion at samples between which no link moves more than 5 mm.

    Attributes:
        positions: (m, n) [rad] or [m]; one only where it goes nowhere.
        tools: (m, 3) in the base frame [m].
        rates: (m,) how far the tool would go in all at its pace there [m].
        clearances: (m,) [m].
        findings: Each with its sample's number, ascending.
        limits: What its target violates.
    """

    positions: FloatArray
    tools: FloatArray
    rates: FloatArray
    clearances: FloatArray
    findings: tuple[tuple[int, Finding], ...]
    limits: tuple[Reason, ...]


@dataclass(frozen=True, eq=False)
class _Wanted:
    """A stretch that is to be looked at."""

    start: FloatArray
    target: FloatArray
    along_line: bool
    positions: FloatArray


class Looker:
    """Looks along the motions of one arm among what is around it.

    Args:
        others: (k, n) straight joint path of each other robot of the cell that counts.
        far: Whether clearances are asked for also where nothing is near.
    """

    def __init__(self, cell: Cell, robot: str, others: Mapping[str, FloatArray], *, far: bool = True) -> None:
        self._cell, self._robot, self._others, self._far = cell, robot, others, far
        self._chain = tool_chain(cell.arms[robot])
        self._kept: dict[_Key, Stretch] = {}
        self._samples = 0

    def stretches(self, start: FloatArray, steps: Sequence[Step]) -> Iterator[tuple[Step, Stretch | None]]:
        """Each step, and what is met on its motion if it has one."""
        at = start
        group: list[tuple[Step, _Key | None]] = []
        wanted: dict[_Key, _Wanted] = {}
        samples = 0
        for step in steps:
            if step.target is None:
                group.append((step, None))
                continue
            key = (at.tobytes(), step.target.tobytes(), step.along_line)
            group.append((step, key))
            if key not in self._kept and key not in wanted:
                wanted[key] = self._wanted(at, step)
                samples += len(wanted[key].positions)
            at = step.target
            if samples >= _TOGETHER:
                yield from self._looked_at(group, wanted)
                group, wanted, samples = [], {}, 0
        yield from self._looked_at(group, wanted)

    def _wanted(self, start: FloatArray, step: Step) -> _Wanted:
        assert step.target is not None
        parts = samples_between(self._chain, start, step.target) if (start != step.target).any() else 0
        if parts > _MOST_BEYOND and violations(self._cell.arms[self._robot].joints, step.target):
            parts = _MOST_BEYOND
        shares = np.linspace(0.0, 1.0, parts + 1)[:, None]
        positions = start + shares * (step.target - start)
        positions[-1] = step.target
        return _Wanted(start, step.target, step.along_line, positions)

    def _looked_at(
        self,
        group: Sequence[tuple[Step, _Key | None]],
        wanted: Mapping[_Key, _Wanted],
    ) -> Iterator[tuple[Step, Stretch | None]]:
        if wanted:
            found = dict(zip(wanted, self._look([*wanted.values()]), strict=True))
            self._samples += sum(len(stretch.positions) for stretch in found.values())
            self._kept |= found
        for step, key in group:
            yield step, None if key is None else self._kept[key]
        if self._samples > _KEPT:
            self._kept.clear()
            self._samples = 0

    def _look(self, wanted: Sequence[_Wanted]) -> Iterator[Stretch]:
        arm = self._cell.arms[self._robot]
        positions = np.concatenate([each.positions for each in wanted])
        ends = np.cumsum([len(each.positions) for each in wanted]).tolist()
        near_m = max(self._cell.arms[name].warning_m for name in (self._robot, *self._others))
        along = near_along(self._cell, self._robot, positions, self._others, within_m=near_m, far=self._far)
        met = [found for each in along.encounters for found in self._findings(each)]
        met.sort(key=itemgetter(0))
        numbers = [number for number, _ in met]
        tools, jacobians = tools_and_jacobians(self._chain, positions)
        begin = 0
        for each, end in zip(wanted, ends, strict=True):
            here = slice(begin, end)
            findings = [
                (number - begin, finding)
                for number, finding in met[bisect_left(numbers, begin) : bisect_left(numbers, end)]
            ]
            if each.along_line:
                types, reach = arm.joints.types, self._chain.reach_m
                findings += _singular(singularity_margins(jacobians[here], types, reach=reach))
            yield Stretch(
                positions=each.positions,
                tools=tools[here, :3, 3],
                rates=np.linalg.norm(jacobians[here, :3] @ (each.target - each.start), axis=1),
                clearances=along.clearances[here],
                findings=tuple(sorted(findings, key=itemgetter(0))),
                limits=violations(arm.joints, each.target),
            )
            begin = end

    def _findings(self, encounter: Encounter) -> Iterator[tuple[int, Finding]]:
        warning, stop = (0.0, 0.0) if encounter.own else distances(self._cell, encounter.pair)
        samples, all_distances = encounter.samples.tolist(), encounter.distances.tolist()
        for index, distance, points in zip(samples, all_distances, encounter.points, strict=True):
            if distance <= 0.0:
                yield index, Finding(ViolationKind.COLLISION, encounter.pair, distance, 0.0, points)
            elif distance < warning:
                stops = distance < stop
                limit = stop if stops else warning
                yield index, Finding(ViolationKind.CLEARANCE, encounter.pair, distance, limit, points, stops)


def _singular(margins: FloatArray) -> list[tuple[int, Finding]]:
    return [
        (index, Finding(ViolationKind.SINGULARITY, (), float(margins[index]), SINGULAR, np.zeros((0, 3))))
        for index in np.flatnonzero(margins < SINGULAR).tolist()
    ]
