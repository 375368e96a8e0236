"""Check of a motion before it is executed: its duration and its violations."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.checks.path import PathSamples
from robots.checks.segments import Segment, SegmentChecker
from robots.checks.violations import ViolationCollector
from robots.collision import Cell, pending, unshaped
from robots.collision.floor import floor_advice
from robots.descriptions.cells import FLOOR
from robots.kinematics.inverse import InverseSolver, build_solver
from robots.kinematics.joints import FloatArray, Joints, as_positions, doubtful_limits, violations
from robots.kinematics.straight_motion import HOMING_REST_S, HOMING_SPEED, straight_motion
from robots.programs.plan import plan_program
from robots.programs.steps import (
    INTERPOLATION,
    CheckReport,
    Plan,
    Step,
    StepKind,
    Violation,
    ViolationKind,
)
from robots.programs.text import parse_program
from robots.schema.errors import ProgramError

# Size of the cache of motions' timings.
_MOST_KEPT = 1_000
# Shares of a motion's duration at which its progress is tabulated, denser at its slow ends.
_TABLE = (1 - np.cos(np.linspace(0.0, np.pi, 129))) / 2


def check_program(
    text: str,
    cell: Cell,
    robot: str,
    start: FloatArray,
    *,
    others: Mapping[str, FloatArray] | None = None,
    solver: InverseSolver | None = None,
    far: bool = True,
) -> CheckReport:
    """Parse, plan and check a program; a text that cannot be read gets violations of kind "program".

    Args:
        start: (n,) the arm's position [rad] or [m].
        others, far: See `check_plan`.
        solver: The arm's solver; by default a new one.

    Raises:
        JointCountError: If some positions do not have one value per joint.
    """
    arm = cell.arms[robot]
    start = as_positions(arm.joints, start)
    try:
        program = parse_program(text, arm.joints)
    except ProgramError as error:
        return _unreadable(error, start)
    solver = build_solver(arm.description) if solver is None else solver
    plan = plan_program(program, arm, solver, start)
    # Every plan begins with a SPEED step.
    if not plan.violations and all(step.kind is StepKind.SPEED for step in plan.steps):
        return _unreadable(ProgramError([(1, codes.PROGRAM_EMPTY())]), start)
    return check_plan(cell, robot, start, plan, others={} if others is None else others, far=far)


def check_plan(
    cell: Cell,
    robot: str,
    start: FloatArray,
    plan: Plan | Sequence[Step],
    *,
    others: Mapping[str, FloatArray],
    far: bool = True,
) -> CheckReport:
    """Check steps against limits, tool speeds, self-collisions and the obstacles of the cell.

    Args:
        start: (n,) the arm's position at rest [rad] or [m].
        plan: A plan, or its steps; before the first SPEED the arm moves at 100 %.
        others: (k, n) straight joint path of each other robot to check against, from its position to its
            commanded target (k = 1: it does not move). The arm is checked against all of it at any time.
        far: Compute exact clearances far from obstacles too, which takes longer.

    Raises:
        JointCountError: If some positions do not have one value per joint.
    """
    arm = cell.arms[robot]
    start = as_positions(arm.joints, start)
    for name, way in others.items():
        for positions in np.atleast_2d(way):
            as_positions(cell.arms[name].joints, positions)
    if not isinstance(plan, Plan):
        plan = Plan(tuple(plan))
    checker = _Checker(arm.joints)
    ways = {name: np.atleast_2d(way) for name, way in others.items() if name != robot}
    segment_checker = SegmentChecker(cell, robot, ways, far=far)
    ends_s = []
    for step, segment in segment_checker.segments(start, (*plan.steps, _final_step(start, plan.steps))):
        checker.take(step, segment)
        ends_s.append(checker.time_s)
    ends = [replace(each, time_s=checker.time_s, until_s=checker.time_s) for each in plan.violations]
    found = (*_start_violations(arm.joints, start), *checker.limits, *checker.runs.violations())
    notes = (*_cover_notes(cell, robot, others), *_floor_notes(cell, found))
    notes = (*notes, *_unreported(checker.runs), *plan.notes)
    result = _result(
        checker.time_s,
        (*sorted(found, key=lambda each: each.time_s), *ends),
        plan.steps,
        notes,
        checker.path,
    )
    durations_s = np.diff(ends_s[:-1], prepend=0.0).tolist()
    alone = cell.floor is None and not len(cell.fixtures) and not ways
    return replace(result, durations_s=tuple(durations_s), alone=alone)


@dataclass(frozen=True, eq=False)
class _Timing:
    """Times of a segment's samples [s], and the rate of its share there [1/s]."""

    duration_s: float
    times_s: FloatArray
    rates: FloatArray


class _Checker:
    """Accumulator of the time and the problems of consecutive steps."""

    def __init__(self, joints: Joints) -> None:
        self.time_s = 0.0
        self.runs = ViolationCollector()
        self.limits: list[Violation] = []
        self.path = PathSamples(len(joints))
        self._joints = joints
        self._speed = 1.0
        self._sample = 0
        self._line, self._line_began = 0, 0
        self._timings: dict[tuple[bytes, bytes, float], _Timing] = {}

    def take(self, step: Step, segment: Segment | None) -> None:
        match step.kind:
            case StepKind.SPEED:
                assert step.percent is not None
                self._speed = step.percent / 100
            case StepKind.WAIT:
                assert step.seconds is not None
                self.time_s += step.seconds
            case StepKind.MOVE | StepKind.HOME:
                assert segment is not None
                homing = step.kind is StepKind.HOME
                self._go(step, segment, self._speed * (HOMING_SPEED if homing else 1.0))
                self.time_s += HOMING_REST_S if homing else 0.0
            case StepKind.TRACE:
                pass

    def _go(self, step: Step, segment: Segment, speed: float) -> None:
        timing = self._timing(segment, speed)
        if step.line != self._line:
            self._line, self._line_began = step.line, self._sample
        times = self.time_s + timing.times_s
        speeds = segment.rates * timing.rates
        self.path.add(times, segment.positions, segment.tools, speeds, segment.clearances, step.line)
        if segment.limits and timing.duration_s > 0:
            self.limits.append(_limit_violation(step.line, segment.limits, self.time_s, times[-1]))
        for index, problem in segment.problems:
            self.runs.add(
                line=step.line,
                sample=self._sample + index,
                time_s=float(times[index]),
                kind=problem.kind,
                value=problem.value,
                limit=problem.limit,
                pair=problem.pair,
                points=problem.points,
                stops=problem.stops,
            )
        if step.tool_speed is not None:
            self._check_tool_speed(step, speeds, times, step.tool_speed)
        self._sample += len(times) - 1
        self.time_s = float(times[-1])

    def _check_tool_speed(self, step: Step, speeds: FloatArray, times: FloatArray, most: float) -> None:
        # Tolerate rounding. The parts of a line each begin and end at rest, but count as one violation.
        for index in np.flatnonzero(speeds > most * (1 + 1e-6)).tolist():
            sample = self._sample + index
            self.runs.add(
                line=step.line,
                sample=sample,
                time_s=float(times[index]),
                kind=ViolationKind.SPEED,
                value=-float(speeds[index]),
                limit=-most,
                within=max(sample - self._line_began, 1),
            )

    def _timing(self, segment: Segment, speed: float) -> _Timing:
        start, target = segment.positions[0], segment.positions[-1]
        key = (start.tobytes(), target.tobytes(), speed)
        timing = self._timings.get(key)
        if timing is None:
            timing = _timing(self._joints, start, target, speed, len(segment.positions))
            if len(self._timings) < _MOST_KEPT:
                self._timings[key] = timing
        return timing


def _final_step(start: FloatArray, steps: Sequence[Step]) -> Step:
    """Return a motion of length 0 at the final position, so that the end is checked."""
    ends = [step.target for step in steps if step.target is not None]
    line = steps[-1].line if steps else 0
    return Step(line=line, kind=StepKind.MOVE, target=ends[-1] if ends else start)


def _limit_violation(line: int, limits: Sequence[Reason], begin_s: float, until_s: float) -> Violation:
    return Violation(
        line=line,
        time_s=begin_s,
        until_s=until_s,
        kind=ViolationKind.LIMIT,
        points=np.zeros((0, 3)),
        reason=codes.JOINTS_OUTSIDE(*limits),
    )


def _timing(joints: Joints, start: FloatArray, target: FloatArray, speed: float, samples: int) -> _Timing:
    motion = straight_motion(joints, start, target, speed=speed)
    if motion is None:
        return _Timing(0.0, np.zeros(samples), np.zeros(samples))
    table = motion.duration * _TABLE
    times = np.interp(np.linspace(0.0, 1.0, samples), motion.progress(table)[0], table)
    times[0], times[-1] = 0.0, motion.duration
    return _Timing(motion.duration, times, motion.progress(times)[1])


def _start_violations(joints: Joints, start: FloatArray) -> tuple[Violation, ...]:
    """Return a warning if the arm starts beyond a limit; it may move back."""
    found = violations(joints, start)
    if not found:
        return ()
    reason = codes.PROGRAM_START_OUTSIDE(*found)
    return (
        Violation(line=0, kind=ViolationKind.LIMIT, points=np.zeros((0, 3)), reason=reason, refuses=False),
    )


def _cover_notes(cell: Cell, robot: str, others: Mapping[str, FloatArray]) -> tuple[Reason, ...]:
    notes = []
    for name in (robot, *(other for other in others if other != robot)):
        if bare := unshaped(cell, name):
            owner = "" if name == robot else f"{name}/"
            links = ", ".join(f"{owner}{link}" for link in bare)
            notes.append(codes.CHECK_NOTE_NO_SHAPE(links=links))
    if doubt := doubtful_limits(robot, cell.arms[robot].joints):
        notes.append(doubt)
    if robot in pending(cell):
        notes.append(codes.CHECK_NOTE_PENDING())
    notes += [
        codes.CHECK_NOTE_LEFT_OUT(name=name) for name in cell.arms if name != robot and name not in others
    ]
    if not len(cell.fixtures) and len(cell.arms) == 1:
        notes.append(codes.CHECK_NOTE_ALONE() if cell.floor is None else codes.CHECK_NOTE_ONLY_FLOOR())
    return tuple(notes)


def _floor_notes(cell: Cell, found: Sequence[Violation]) -> tuple[Reason, ...]:
    heights = [each.points[0, 2] for each in found if FLOOR in each.pair]
    if not heights or cell.floor is None:
        return ()
    return (floor_advice(cell.floor, min(heights)),)


def _unreported(runs: ViolationCollector) -> tuple[Reason, ...]:
    return (codes.CHECK_NOTE_MORE_VIOLATIONS(count=runs.unreported),) if runs.unreported else ()


def _unreadable(error: ProgramError, start: FloatArray) -> CheckReport:
    found = tuple(
        Violation(
            line=line,
            kind=ViolationKind.PROGRAM,
            points=np.zeros((0, 3)),
            reason=codes.PROGRAM_UNREADABLE(reason),
        )
        for line, reason in error.problems
    )
    more = error.found - len(found)
    notes = (codes.CHECK_NOTE_MORE_PROBLEMS(count=more),) if more else ()
    return _result(0.0, found, (), notes, PathSamples(len(start)))


def _result(
    duration_s: float,
    found: tuple[Violation, ...],
    steps: tuple[Step, ...],
    notes: tuple[Reason, ...],
    path: PathSamples,
) -> CheckReport:
    return CheckReport(
        ok=not found,
        duration_s=duration_s,
        violations=found,
        steps=steps,
        interpolation=INTERPOLATION,
        notes=notes,
        path=path.sampled(),
    )
