"""Checks of straight joint motions for collisions, clearances and singularities, at any speed."""

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import TypeAlias

import numpy as np

from robomesh.reasons import Reason
from robots.checks.tool_chain import samples_between, tool_chain, tools_and_jacobians
from robots.collision import Cell, distances
from robots.collision.continuous import Encounter, path_encounters
from robots.kinematics.joints import FloatArray, violations
from robots.kinematics.singularity import singularity_margins
from robots.programs.steps import Step, ViolationKind

# Least singularity margin on a line of the tool; see `robots.kinematics.singularity`.
SINGULAR = 0.02

# Samples of several motions that are checked together, so that far obstacles are measured once for many.
_TOGETHER = 4_000
# Samples of cached motions, which may be repeated.
_CACHED = 100_000
# Samples of a motion to a target beyond its limits, which is refused anyway.
_MOST_BEYOND = 500
# A segment's start and target, bit for bit, and whether it is part of a line.
_Key: TypeAlias = tuple[bytes, bytes, bool]


@dataclass(frozen=True, eq=False)
class SampleProblem:
    """A problem at a sample.

    Attributes:
        kind: COLLISION, CLEARANCE or SINGULARITY.
        pair: The names of the pair; empty for SINGULARITY.
        value: The smaller the worse: a distance [m], negative below the floor, or a margin.
        limit: Lower limit of the value.
        points: (k, 3) in the site's frame [m].
        stops: Whether the motion is refused.
    """

    kind: ViolationKind
    pair: tuple[str, ...]
    value: float
    limit: float
    points: FloatArray
    stops: bool = True


@dataclass(frozen=True, eq=False)
class Segment:
    """A straight joint motion, sampled so that no link moves more than 5 mm between samples.

    Attributes:
        positions: (m, n) [rad] or [m]; only one for a motion of length 0.
        tools: (m, 3) in the base frame [m].
        rates: (m,) the tool's speed per share of the motion [m].
        clearances: (m,) [m].
        problems: Each with its sample's number, ascending.
        limits: Limits that the target violates.
    """

    positions: FloatArray
    tools: FloatArray
    rates: FloatArray
    clearances: FloatArray
    problems: tuple[tuple[int, SampleProblem], ...]
    limits: tuple[Reason, ...]


@dataclass(frozen=True, eq=False)
class _Request:
    """A segment to check."""

    start: FloatArray
    target: FloatArray
    along_line: bool
    positions: FloatArray


class SegmentChecker:
    """Checks of one arm's motions in its cell, with a cache of repeated ones.

    Args:
        others: (k, n) straight joint path of each other robot to check against.
        far: Compute exact clearances far from obstacles too.
    """

    def __init__(self, cell: Cell, robot: str, others: Mapping[str, FloatArray], *, far: bool = True) -> None:
        self._cell, self._robot, self._others, self._far = cell, robot, others, far
        self._chain = tool_chain(cell.arms[robot])
        self._cached: dict[_Key, Segment] = {}
        self._samples = 0

    def segments(self, start: FloatArray, steps: Sequence[Step]) -> Iterator[tuple[Step, Segment | None]]:
        """Yield each step, with the checked segment of its motion if it has one."""
        at = start
        group: list[tuple[Step, _Key | None]] = []
        requests: dict[_Key, _Request] = {}
        samples = 0
        for step in steps:
            if step.target is None:
                group.append((step, None))
                continue
            key = (at.tobytes(), step.target.tobytes(), step.along_line)
            group.append((step, key))
            if key not in self._cached and key not in requests:
                requests[key] = self._request(at, step)
                samples += len(requests[key].positions)
            at = step.target
            if samples >= _TOGETHER:
                yield from self._checked(group, requests)
                group, requests, samples = [], {}, 0
        yield from self._checked(group, requests)

    def _request(self, start: FloatArray, step: Step) -> _Request:
        assert step.target is not None
        parts = samples_between(self._chain, start, step.target) if (start != step.target).any() else 0
        if parts > _MOST_BEYOND and violations(self._cell.arms[self._robot].joints, step.target):
            parts = _MOST_BEYOND
        shares = np.linspace(0.0, 1.0, parts + 1)[:, None]
        positions = start + shares * (step.target - start)
        positions[-1] = step.target
        return _Request(start, step.target, step.along_line, positions)

    def _checked(
        self,
        group: Sequence[tuple[Step, _Key | None]],
        requests: Mapping[_Key, _Request],
    ) -> Iterator[tuple[Step, Segment | None]]:
        if requests:
            found = dict(zip(requests, self._check([*requests.values()]), strict=True))
            self._samples += sum(len(segment.positions) for segment in found.values())
            self._cached |= found
        for step, key in group:
            yield step, None if key is None else self._cached[key]
        if self._samples > _CACHED:
            self._cached.clear()
            self._samples = 0

    def _check(self, requests: Sequence[_Request]) -> Iterator[Segment]:
        arm = self._cell.arms[self._robot]
        positions = np.concatenate([each.positions for each in requests])
        ends = np.cumsum([len(each.positions) for each in requests]).tolist()
        near_m = max(self._cell.arms[name].warning_m for name in (self._robot, *self._others))
        along = path_encounters(
            self._cell, self._robot, positions, self._others, within_m=near_m, far=self._far
        )
        numbered = [found for each in along.encounters for found in self._problems(each)]
        numbered.sort(key=itemgetter(0))
        numbers = [number for number, _ in numbered]
        tools, jacobians = tools_and_jacobians(self._chain, positions)
        begin = 0
        for each, end in zip(requests, ends, strict=True):
            here = slice(begin, end)
            problems = [
                (number - begin, problem)
                for number, problem in numbered[bisect_left(numbers, begin) : bisect_left(numbers, end)]
            ]
            if each.along_line:
                types, reach = arm.joints.types, self._chain.reach_m
                problems += _singular(singularity_margins(jacobians[here], types, reach=reach))
            yield Segment(
                positions=each.positions,
                tools=tools[here, :3, 3],
                rates=np.linalg.norm(jacobians[here, :3] @ (each.target - each.start), axis=1),
                clearances=along.clearances[here],
                problems=tuple(sorted(problems, key=itemgetter(0))),
                limits=violations(arm.joints, each.target),
            )
            begin = end

    def _problems(self, encounter: Encounter) -> Iterator[tuple[int, SampleProblem]]:
        warning, stop = (0.0, 0.0) if encounter.own else distances(self._cell, encounter.pair)
        samples, all_distances = encounter.samples.tolist(), encounter.distances.tolist()
        for index, distance, points in zip(samples, all_distances, encounter.points, strict=True):
            if distance <= 0.0:
                yield index, SampleProblem(ViolationKind.COLLISION, encounter.pair, distance, 0.0, points)
            elif distance < warning:
                stops = distance < stop
                limit = stop if stops else warning
                yield (
                    index,
                    SampleProblem(ViolationKind.CLEARANCE, encounter.pair, distance, limit, points, stops),
                )


def _singular(margins: FloatArray) -> list[tuple[int, SampleProblem]]:
    return [
        (
            index,
            SampleProblem(ViolationKind.SINGULARITY, (), float(margins[index]), SINGULAR, np.zeros((0, 3))),
        )
        for index in np.flatnonzero(margins < SINGULAR).tolist()
    ]
