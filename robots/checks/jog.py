"""A jog: a line of the tool, or a motion of one joint, planned and checked a few millimetres at a time.

An operator drives the arm by it while a button is held, so its end is unknown. Each part is planned from the
line's origin by the planner of `move_line_by`, so that the parts are one line.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi

import numpy as np

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.checks.check import check_plan
from robots.checks.tool_chain import tool_chain, tools_and_jacobians
from robots.collision import Cell
from robots.kinematics.inverse import InverseSolver, Task, natural_task
from robots.kinematics.joints import FloatArray, violations
from robots.kinematics.model import tool_placement
from robots.programs.jog_steps import AHEAD_M, AHEAD_RAD, Jog
from robots.programs.plan import axes_of, plan_line_part
from robots.programs.steps import Step, StepKind, Violation, ViolationKind
from robots.schema.poses import axis_rotation

# Least part that is commanded by itself, as a share of these: below, the arm would only be disturbed.
_LEAST_PART = 0.1
# Least part for which an end of the line is searched, as a share.
_LEAST_END = 0.05

# As for steps of the tool, whatever speed of the tool that gives.
_MOST_PERCENT = 25.0
_LEAST_PERCENT = 1.0
# Margin for a controller whose joints do not run exactly in phase when a target is replaced.
_SPEED_MARGIN = 0.9


@dataclass(frozen=True, kw_only=True)
class JogPart:
    """The next part of a jog, and how far the arm is.

    Attributes:
        target: (n,) its end [rad] or [m]; None: nothing is to be commanded now.
        commanded: Distance of the newest target from the origin [m] or [rad].
        moved: Distance of the arm from the origin [m] or [rad].
        percent: Speed of the motion to `target`, as a percentage of the joints' maximum speeds.
        end: Why the jog cannot go on beyond `commanded`; None: it can, as far as is known.
        violations: Problems of the part that do not end it.
    """

    target: FloatArray | None
    commanded: float
    moved: float
    percent: float = 0.0
    end: Reason | None = None
    violations: tuple[Violation, ...] = field(default=())


def next_part(
    cell: Cell,
    robot: str,
    solver: InverseSolver,
    jog: Jog,
    *,
    origin: FloatArray,
    measured: FloatArray,
    last: FloatArray,
    commanded: float,
    others: Mapping[str, FloatArray],
    collisions: bool = True,
    more: bool = True,
) -> JogPart:
    """Plan and check the next part of a jog.

    Args:
        origin: (n,) positions where the jog began [rad] or [m].
        measured: (n,) the arm's positions.
        last: (n,) the newest commanded target; the origin if there is none.
        commanded: Its distance from the origin [m] or [rad].
        others: (k, n) path of each other robot, see `check_plan`.
        collisions: Collisions and clearances end the jog.
        more: Plan a part; otherwise return only how far the arm is.
    """
    line = _Line(cell, robot, solver, jog, origin)
    moved = line.distance(measured, near=commanded)
    part = moved + line.most_ahead - commanded
    if not more or part < _LEAST_PART * line.most_ahead:
        return JogPart(target=None, commanded=commanded, moved=moved)
    while True:
        target = line.part(last, commanded + part)
        if not isinstance(target, Reason):
            found = _violations(cell, robot, measured, last, target, others, along=jog.frame is not None)
            ends = [each for each in found if each.refuses and (collisions or each.kind not in _COLLISIONS)]
            if not ends:
                break
            target = ends[0].reason if len(ends) == 1 else codes.SEVERAL(*(each.reason for each in ends[:3]))
        # Nearer to the end; the next part finds it again.
        part /= 2
        if part < _LEAST_END * line.most_ahead:
            return JogPart(target=None, commanded=commanded, moved=moved, end=target)
    percent = line.percent(measured, target)
    if isinstance(percent, Reason):
        return JogPart(target=None, commanded=commanded, moved=moved, end=percent)
    return JogPart(
        target=target,
        commanded=line.distance(target, near=commanded),
        moved=moved,
        percent=percent,
        violations=tuple(each for each in found if not each.refuses),
    )


_COLLISIONS = (ViolationKind.COLLISION, ViolationKind.CLEARANCE)


class _Line:
    """The way of a jog from its origin."""

    def __init__(self, cell: Cell, robot: str, solver: InverseSolver, jog: Jog, origin: FloatArray) -> None:
        self._arm, self._solver, self._jog, self._origin = cell.arms[robot], solver, jog, origin
        self._sign = 1.0 if jog.speed > 0 else -1.0
        self._turns = jog.turns(self._arm.joints)
        self.most_ahead = AHEAD_RAD if self._turns else AHEAD_M
        if jog.frame is not None:
            self._tool = tool_placement(self._arm.model, origin)
            self._way = self._sign * axes_of(jog.frame, self._arm, self._tool)[:, jog.axis % 3]

    def distance(self, positions: FloatArray, *, near: float) -> float:
        """Return how far along the way joint positions are from the origin [m] or [rad].

        Args:
            near: A distance less than half a turn from it.
        """
        if self._jog.frame is None:
            return float(self._sign * (positions - self._origin)[self._jog.axis])
        tool = tool_placement(self._arm.model, positions)
        if not self._turns:
            return float((tool[:3, 3] - self._tool[:3, 3]) @ self._way)
        # Of the tool's axes, the one that the way turns most shows the angle best; a 5d task has only z.
        only_z = natural_task(self._arm.joints) is Task.POSITION_AND_AXIS_5D
        shown = 2 if only_z else int(np.abs(self._way @ self._tool[:3, :3]).argmin())
        angle = _angle_about(self._way, self._tool[:3, shown], tool[:3, shown])
        return angle + 2 * pi * round((near - angle) / (2 * pi))

    def part(self, last: FloatArray, until: float) -> FloatArray | Reason:
        """Return the end of the next joint move towards a distance; or why there is none."""
        if self._jog.frame is None:
            target = self._origin.copy()
            target[self._jog.axis] += self._sign * until
            beyond = violations(self._arm.joints, target)
            return codes.JOINTS_OUTSIDE(*beyond) if beyond else target
        offset = np.eye(4)
        if self._turns:
            offset[:3, :3] = axis_rotation(self._way, until)
        else:
            offset[:3, 3] = until * self._way
        return plan_line_part(self._arm, self._solver, origin=self._origin, at=last, offset=offset)

    def percent(self, start: FloatArray, target: FloatArray) -> float | Reason:
        """Return the speed of a motion that keeps to the jog's speed and its tool's; or why there is none."""
        chain = tool_chain(self._arm)
        _, jacobians = tools_and_jacobians(chain, np.array([start, (start + target) / 2, target]))
        way = target - start
        # Share of the way in a second at full speed, by the joint that is the first at its limit.
        moving = np.abs(way) > 1e-12
        if not moving.any():
            return _LEAST_PERCENT
        rate = float((self._arm.joints.max_speed[moving] / np.abs(way[moving])).min())
        speeds = np.linalg.norm((jacobians @ way).reshape(-1, 2, 3), axis=2).max(axis=0) * rate
        if self._jog.frame is None:
            own = float(self._arm.joints.max_speed[self._jog.axis])
        else:
            own = float(speeds[1 if self._turns else 0])
        limits = [(abs(self._jog.speed), own), (self._jog.tool_speed, float(speeds[0]))]
        percent = min(100.0 * _SPEED_MARGIN * most / speed for most, speed in limits if speed > 1e-9)
        if percent < _LEAST_PERCENT:
            return codes.JOG_TOO_FAST(percent=_LEAST_PERCENT, tool_mm_s=speeds[0] * 10 * _LEAST_PERCENT)
        return min(percent, _MOST_PERCENT)


def _angle_about(axis: FloatArray, one: FloatArray, other: FloatArray) -> float:
    """Return the angle [rad] between two directions (3,), about an axis."""
    return float(np.arctan2(axis @ np.cross(one, other), one @ other - (axis @ one) * (axis @ other)))


def _violations(
    cell: Cell,
    robot: str,
    measured: FloatArray,
    last: FloatArray,
    target: FloatArray,
    others: Mapping[str, FloatArray],
    *,
    along: bool,
) -> tuple[Violation, ...]:
    """Return what is found on the way from the arm's positions through its last target to the next one."""
    steps = [Step(line=0, kind=StepKind.MOVE, target=each, along_line=along) for each in (last, target)]
    return check_plan(cell, robot, measured, steps, others=others, far=False).violations
