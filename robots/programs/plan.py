"""Planner from a program to steps for a controller: unrolls repeats, cuts lines into joint moves."""

from collections.abc import Mapping, Sequence
from math import degrees, radians

import numpy as np

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.collision import Arm
from robots.kinematics.inverse import InverseSolver, Task, natural_task, solve
from robots.kinematics.inverse.tasks import tool_misses
from robots.kinematics.joints import FloatArray
from robots.kinematics.model import tool_placement
from robots.programs.lines import (
    BENT_DEG,
    Followed,
    UnreachableError,
    follow_line,
    line_to,
    nearest_axis,
    try_line,
    why_stuck,
)
from robots.programs.statements import (
    Home,
    JointTarget,
    MoveJoints,
    MoveLine,
    MoveLineBy,
    PoseTarget,
    Program,
    Repeat,
    Speed,
    Statement,
    StepFrame,
    Target,
    ToolSpeed,
    Trace,
    Wait,
)
from robots.programs.steps import LINE_DEG, LINE_M, Plan, Step, StepKind, Violation, ViolationKind
from robots.programs.text import MOST_STEPS

# Positions are rounded to 1e-9 rad and m, so that a repeat returns to bit-identical positions.
_DECIMALS = 9
# Size of the cache of cut lines.
_MOST_KEPT = 1_000


def plan_program(program: Program, arm: Arm, solver: InverseSolver | None, start: FloatArray) -> Plan:
    """Plan the steps of a program from the arm's position.

    The plan begins with a SPEED step, of 100 % unless the program sets the speed, because a check cannot know
    the controller's current setting. It ends at a pose that cannot be reached.

    Args:
        solver: The arm's solver; may be None for a program without poses and lines.
        start: (n,) joint positions [rad] or [m].
    """
    planner = _Planner(arm, solver, start)
    violations: tuple[Violation, ...] = ()
    notes: tuple[Reason, ...] = ()
    try:
        planner.take(program.statements)
    except _PlanEndsError as end:
        violations = (end.violation,)
        notes = (codes.CHECK_NOTE_ENDS(line=end.violation.line),)
    return Plan(tuple(planner.steps), violations, (*_bent_notes(planner.bent), *notes))


def _bent_notes(bent: Mapping[int, float]) -> tuple[Reason, ...]:
    if not bent:
        return ()
    lines = ", ".join(str(line) for line in sorted(bent)[:10]) + (", ..." if len(bent) > 10 else "")
    most = degrees(max(bent.values()))
    return (codes.CHECK_NOTE_BENT(angle_deg=most, lines=lines),)


def plan_line_part(
    arm: Arm, solver: InverseSolver, *, origin: FloatArray, at: FloatArray, offset: FloatArray
) -> FloatArray | Reason:
    """Plan the next joint move of a line that is followed part by part, as `move_line_by` plans it.

    Args:
        origin: (n,) joint positions at the line's beginning [rad] or [m].
        at: (n,) joint positions on the line, where this part begins.
        offset: (4, 4) this part's end, from the origin, along and about the base's axes.

    Returns:
        (n,) the end of one joint move, perhaps before the part's end; or why the part cannot be followed.
    """
    planner = _Planner(arm, solver, at)
    try:
        end = planner.moved(0, StepFrame.BASE, offset, origin=origin)
    except _PlanEndsError as error:
        return error.violation.reason
    line = line_to(tool_placement(arm.model, at), end, natural_task(arm.joints))
    followed = try_line(arm.model, solver, line, at)
    if isinstance(followed, Followed):
        return _rounded(followed.ends[0])
    # The solver's own search for a reason may take seconds.
    return why_stuck(arm.model, line, at)


def axes_of(frame: StepFrame, arm: Arm, tool: FloatArray) -> FloatArray:
    """Return the (3, 3) axes of a step's frame in the base frame, as columns.

    Args:
        tool: (4, 4) tool to base.
    """
    match frame:
        case StepFrame.TOOL:
            return tool[:3, :3]
        case StepFrame.BASE:
            return np.eye(3)
        case StepFrame.SITE:
            return arm.base_to_site[:3, :3].T


class _PlanEndsError(Exception):
    """The plan ends here."""

    def __init__(self, violation: Violation) -> None:
        self.violation = violation
        super().__init__(violation.text)


class _Planner:
    def __init__(self, arm: Arm, solver: InverseSolver | None, start: FloatArray) -> None:
        self.steps: list[Step] = []
        self.bent: dict[int, float] = {}
        self._arm, self._solver = arm, solver
        self._task = natural_task(arm.joints)
        self._at = start
        self._speed_set = False
        self._tool_speed: float | None = None
        self._cut: dict[tuple[bytes, bytes], list[FloatArray]] = {}

    def take(self, statements: Sequence[Statement]) -> None:
        for statement in statements:
            match statement:
                case Home(line):
                    self._move(line, self._arm.joints.home, kind=StepKind.HOME)
                case MoveJoints(line, JointTarget(positions)):
                    self._move(line, positions)
                case MoveJoints(line, PoseTarget() as target):
                    self._move(line, self._solved(line, target))
                case MoveLine(line, target):
                    for positions in self._line(line, self._pose(target)):
                        self._move(line, positions, along_line=True)
                case MoveLineBy(line, frame, offset):
                    for positions in self._line(line, self.moved(line, frame, offset, origin=self._at)):
                        self._move(line, positions, along_line=True)
                case Speed(line, percent):
                    self._speed_set = True
                    self._add(Step(line=line, kind=StepKind.SPEED, percent=percent))
                case ToolSpeed(most=most):
                    self._tool_speed = most
                case Wait(line, seconds):
                    self._add(Step(line=line, kind=StepKind.WAIT, seconds=seconds))
                case Trace(line, on):
                    self._add(Step(line=line, kind=StepKind.TRACE, on=on))
                case Repeat(count=count, body=body):
                    for _ in range(count if body else 0):
                        self.take(body)

    def _add(self, step: Step) -> None:
        # One more than the limit, for the initial SPEED step.
        if len(self.steps) > MOST_STEPS:
            reason = codes.PROGRAM_UNREADABLE(codes.PROGRAM_STEPS_OF_LINES(most=MOST_STEPS))
            raise _PlanEndsError(_violation(step.line, ViolationKind.PROGRAM, reason))
        self.steps.append(step)

    def _move(
        self, line: int, target: FloatArray, *, kind: StepKind = StepKind.MOVE, along_line: bool = False
    ) -> None:
        if not self._speed_set:
            self._speed_set = True
            self._add(Step(line=line, kind=StepKind.SPEED, percent=100.0))
        self._add(
            Step(line=line, kind=kind, target=target, along_line=along_line, tool_speed=self._tool_speed)
        )
        self._at = target

    def _solved(self, line: int, target: PoseTarget) -> FloatArray:
        """Return the joint positions of a pose, nearest to the arm's position."""
        assert self._solver is not None
        result = solve(self._solver, target.tool_to_base, task=self._task, near=self._at)
        if result.reason is not None:
            place = target.tool_to_base[:3, 3]
            raise self._unreachable(line, _pose_unreachable(target, result.reason), place)
        return _rounded(result.solutions[0])

    def _pose(self, target: Target) -> FloatArray:
        if isinstance(target, PoseTarget):
            return target.tool_to_base
        return tool_placement(self._arm.model, target.positions)

    def moved(self, line: int, frame: StepFrame, offset: FloatArray, *, origin: FloatArray) -> FloatArray:
        """Return the tool's pose (4, 4) at `origin` moved by an offset; it turns about its origin."""
        tool = tool_placement(self._arm.model, origin)
        axes = axes_of(frame, self._arm, tool)
        moved = tool.copy()
        moved[:3, 3] += axes @ offset[:3, 3]
        turn = axes @ offset[:3, :3] @ axes.T
        moved[:3, :3] = turn @ tool[:3, :3]
        if self._task is not Task.POSITION_AND_AXIS_5D:
            return moved
        if np.allclose(turn, np.eye(3)):
            return self._with_nearest_axis(line, moved)
        if np.allclose(turn @ tool[:3, 2], tool[:3, 2]):
            raise self._unreachable(line, codes.LINE_ROLL(), tool[:3, 3])
        return moved

    def _with_nearest_axis(self, line: int, pose: FloatArray) -> FloatArray:
        """Return a pose with its axis as a five-joint arm can reach it there, if it need not turn far."""
        model = self._arm.model
        reached = tool_placement(model, nearest_axis(model, pose, self._at))
        away, off = tool_misses(reached, pose, self._task)
        if away > LINE_M / 100 or off > radians(BENT_DEG):
            return pose  # for which the solver gives the reason
        if off > radians(LINE_DEG):
            self.bent[line] = max(off, self.bent.get(line, 0.0))
        return reached

    def _line(self, number: int, end: FloatArray) -> Sequence[FloatArray]:
        assert self._solver is not None
        key = (self._at.tobytes(), end.tobytes())
        if key in self._cut:
            return self._cut[key]
        line = line_to(tool_placement(self._arm.model, self._at), end, self._task)
        try:
            followed = follow_line(self._arm.model, self._solver, line, self._at)
        except UnreachableError as error:
            reason = codes.LINE_NOT_FOLLOWED(error.reason)
            if line.length_m > 1e-6:
                done_mm, length_mm = error.done_m * 1000, line.length_m * 1000
                reason = codes.LINE_NOT_FOLLOWED_BEYOND(error.reason, done_mm=done_mm, length_mm=length_mm)
            raise self._unreachable(number, reason, error.place) from None
        if followed.bent_rad > radians(LINE_DEG):
            self.bent[number] = max(followed.bent_rad, self.bent.get(number, 0.0))
        ends = [_rounded(each) for each in followed.ends]
        if len(self._cut) < _MOST_KEPT:
            self._cut[key] = ends
        return ends

    def _unreachable(self, line: int, reason: Reason, place: FloatArray) -> _PlanEndsError:
        in_site = self._arm.base_to_site[:3, :3] @ place + self._arm.base_to_site[:3, 3]
        return _PlanEndsError(
            _violation(
                line, ViolationKind.UNREACHABLE, codes.PROGRAM_UNREACHABLE(reason), points=in_site[None]
            )
        )


def _violation(line: int, kind: ViolationKind, reason: Reason, points: FloatArray | None = None) -> Violation:
    return Violation(
        line=line, kind=kind, reason=reason, points=np.zeros((0, 3)) if points is None else points
    )


def _rounded(positions: FloatArray) -> FloatArray:
    rounded: FloatArray = positions.round(_DECIMALS) + 0.0
    return rounded


def _pose_unreachable(target: PoseTarget, why: Reason) -> Reason:
    if target.name:
        return codes.POINT_UNREACHABLE(why, name=target.name)
    x, y, z = (target.tool_to_base[:3, 3] * 1000).tolist()
    return codes.POSE_UNREACHABLE(why, place=f"{x:.1f} {y:.1f} {z:.1f}")
