"""Straight lines of the tool, cut into joint moves within a tolerance."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import radians

import numpy as np

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.kinematics.inverse import InverseSolver, Task, follow, solve
from robots.kinematics.inverse.tasks import tool_misses
from robots.kinematics.joints import FloatArray, violations
from robots.kinematics.model import RobotModel, tool_jacobian, tool_placement
from robots.programs.steps import LINE_DEG, LINE_M
from robots.schema.poses import axis_rotation

# Shares of a joint move at which the tool is compared with the line, and the used part of the tolerance: the
# rest is a margin for the intervals.
_SHARES = (0.25, 0.5, 0.75)
_USED_TOLERANCE = 0.9
# After this number of halvings, a line of 1.6 m has parts below 0.1 mm. A part that fails then is a jump.
_MOST_HALVINGS = 14
# Largest deviation of the tool's axis of a five-joint arm from a uniform rotation between a line's ends.
BENT_DEG = 15.0
# Search for this axis: steps, and the weight of a metre off the line in radians of the axis.
_STEPS = 12
# A joint nearer to its limit than this [rad] or [m] is what a short line fails at.
_NEAR_LIMIT = 0.02
_PLACE_WEIGHT = 1000.0


class UnreachableError(Exception):
    """A pose on a line that the arm cannot reach.

    Attributes:
        reason: The reason.
        place: (3,) its position in the base frame [m].
        done_m: Length of the line that can be followed.
    """

    def __init__(self, reason: Reason, place: FloatArray, done_m: float) -> None:
        self.reason, self.place, self.done_m = reason, place, done_m
        super().__init__(reason.text)


@dataclass(frozen=True, eq=False)
class Line:
    """A tool's straight, uniform translation, with a uniform rotation about one axis.

    Attributes:
        begin: (4, 4) tool to base [m].
        way: (3,) [m].
        turn: (3,) axis times angle [rad], in the base frame.
        task: The constrained part of the tool's pose.
    """

    begin: FloatArray
    way: FloatArray
    turn: FloatArray
    task: Task

    @property
    def length_m(self) -> float:
        """Length of the translation."""
        return float(np.linalg.norm(self.way))

    def pose(self, share: float) -> FloatArray:
        """Return the tool's pose (4, 4) at a share of the line, 0 to 1."""
        pose = self.begin.copy()
        pose[:3, 3] += share * self.way
        pose[:3, :3] = axis_rotation(self.turn, share * float(np.linalg.norm(self.turn))) @ pose[:3, :3]
        return pose

    def share_of(self, tool: FloatArray, otherwise: float) -> float:
        """Return the share of the line nearest to a tool (4, 4); `otherwise` for a line of length 0."""
        if self.length_m < 1e-6:
            return otherwise
        along = float((tool[:3, 3] - self.begin[:3, 3]) @ self.way) / self.length_m**2
        return min(max(along, 0.0), 1.0)


def line_to(begin: FloatArray, end: FloatArray, task: Task) -> Line:
    """Return the line from one tool pose to another; a 5d task ignores the roll."""
    if task is Task.POSITION_AND_AXIS_5D:
        turn = _turn_of_axis(begin[:3, 2], end[:3, 2])
    else:
        turn = _turn(end[:3, :3] @ begin[:3, :3].T)
    return Line(begin, end[:3, 3] - begin[:3, 3], turn, task)


def _turn_of_axis(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the smallest rotation (3,) of one direction to another [rad]."""
    across = np.cross(one, other)
    sine = float(np.linalg.norm(across))
    angle = float(np.arctan2(sine, one @ other))
    if sine < 1e-9:
        # The directions are parallel or opposite: any perpendicular axis will do.
        across = np.cross(one, np.eye(3)[int(np.abs(one).argmin())])
        sine = float(np.linalg.norm(across))
    turn: FloatArray = across / sine * angle
    return turn


def _turn(rotation: FloatArray) -> FloatArray:
    """Return axis times angle (3,) of a (3, 3) rotation [rad]."""
    vector = np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    sine = float(np.linalg.norm(vector)) / 2
    angle = float(np.arctan2(sine, (np.trace(rotation) - 1) / 2))
    if sine > 1e-6:
        turned: FloatArray = vector / (2 * sine) * angle
        return turned
    # The angle is nearly 0 or 180 degrees: take the direction that the rotation leaves unchanged.
    column = np.eye(3) + rotation
    axis = column[:, int(np.linalg.norm(column, axis=0).argmax())]
    half: FloatArray = axis / np.linalg.norm(axis) * angle
    return half


@dataclass(frozen=True, eq=False)
class Followed:
    """A line as joint moves.

    Attributes:
        ends: End of each move, (n,) [rad] or [m]; the last is the line's end.
        bent_rad: Largest deviation of the tool's axis from a uniform rotation, which the arm cannot follow.
    """

    ends: tuple[FloatArray, ...]
    bent_rad: float = 0.0


def follow_line(model: RobotModel, solver: InverseSolver, line: Line, start: FloatArray) -> Followed:
    """Approximate a line by joint moves.

    At each position, a five-joint arm can reach only some directions of the tool's axis. Between the line's
    ends, the axis is then as near as possible to a uniform rotation, within BENT_DEG.

    Args:
        start: (n,) joint positions at the line's beginning.

    Raises:
        UnreachableError: If the arm cannot reach the end, or would have to jump to another posture.
    """
    followed = try_line(model, solver, line, start)
    if isinstance(followed, Followed):
        return followed
    raise _unreachable(model, solver, line, followed)


def try_line(
    model: RobotModel, solver: InverseSolver, line: Line, start: FloatArray
) -> "Followed | _StuckError":
    """Approximate a line like `follow_line`, but without a search for the reason of a failure."""
    for bent in (False, True) if line.task is Task.POSITION_AND_AXIS_5D else (False,):
        follower = _Follower(model, solver, line, bent=bent)
        try:
            return Followed(tuple(follower.ends(start)), follower.bent_rad)
        except _StuckError as error:
            stuck = error
    return stuck


class _StuckError(Exception):
    """No joint move continues from a share of the line, with the arm at given positions."""

    def __init__(self, begin: float, end: float, at: FloatArray) -> None:
        self.begin, self.end, self.at = begin, end, at
        super().__init__()


class _Follower:
    def __init__(self, model: RobotModel, solver: InverseSolver, line: Line, *, bent: bool) -> None:
        self.bent_rad = 0.0
        self._model, self._solver, self._line, self._bent = model, solver, line, bent

    def ends(self, start: FloatArray) -> Iterator[FloatArray]:
        """Yield the ends of joint moves, halving the line until each part is within the tolerance."""
        at, begin = start, 0.0
        ahead = [(1.0, _MOST_HALVINGS)]
        while ahead:
            end, halvings = ahead[-1]
            target = self._at(end, at)
            if target is not None and self._keeps_to(at, target, begin, end):
                yield target
                at, begin = target, end
                ahead.pop()
            elif halvings == 0:
                raise _StuckError(begin, end, at)
            else:
                ahead[-1] = (end, halvings - 1)
                ahead.append(((begin + end) / 2, halvings - 1))

    def _at(self, share: float, near: FloatArray) -> FloatArray | None:
        """Return joint positions at a share of the line, on the branch of `near`; None if there are none."""
        line = self._line
        if not self._bent or share == 1.0:
            return follow(self._solver, line.pose(share), task=line.task, near=near)
        positions = nearest_axis(self._model, line.pose(share), near)
        if _bent_problem(self._model, line.pose(share), positions):
            return None
        off = tool_misses(tool_placement(self._model, positions), line.pose(share), line.task)[1]
        self.bent_rad = max(self.bent_rad, off)
        return positions

    def _keeps_to(self, one: FloatArray, other: FloatArray, begin: float, end: float) -> bool:
        """Return whether the tool stays within the tolerance of the line on a straight joint motion."""
        for share in _SHARES:
            positions = one + share * (other - one)
            tool = tool_placement(self._model, positions)
            wanted = self._line.pose(self._line.share_of(tool, begin + share * (end - begin)))
            if self._bent:
                wanted = tool_placement(self._model, nearest_axis(self._model, wanted, positions))
            away, angle = tool_misses(tool, wanted, self._line.task)
            if away > LINE_M * _USED_TOLERANCE or angle > radians(LINE_DEG) * _USED_TOLERANCE:
                return False
        return True


def _unreachable(
    model: RobotModel, solver: InverseSolver, line: Line, stuck: _StuckError
) -> UnreachableError:
    pose = line.pose(stuck.end)
    return UnreachableError(
        _reason(model, solver, line, pose, stuck), pose[:3, 3], stuck.begin * line.length_m
    )


def _reason(
    model: RobotModel, solver: InverseSolver, line: Line, pose: FloatArray, stuck: _StuckError
) -> Reason:
    """Return why the arm cannot reach a pose of the line."""
    end = solve(solver, line.pose(1.0), task=line.task, near=stuck.at)
    if end.reason is not None:
        return codes.LINE_END(end.reason)
    result = solve(solver, pose, task=line.task, near=stuck.at)
    if result.reason is None:
        leaps = np.abs(result.solutions[0] - stuck.at) / (model.joints.upper - model.joints.lower)
        first = model.joints.names[int(leaps.argmax())]
        return codes.LINE_JUMP(name=first)
    if line.task is Task.POSITION_AND_AXIS_5D:
        bent = _bent_problem(model, pose, nearest_axis(model, pose, stuck.at))
        return bent or result.reason
    return result.reason


def why_stuck(model: RobotModel, line: Line, at: FloatArray) -> Reason:
    """Return why a short line from joint positions cannot be followed, as far as that shows without a search.

    Args:
        at: (n,) [rad] or [m].
    """
    joints = model.joints
    margins = np.minimum(at - joints.lower, joints.upper - at)
    nearest = int(margins.argmin())
    if margins[nearest] < _NEAR_LIMIT:
        return codes.LINE_AT_LIMIT(name=joints.names[nearest])
    if line.task is Task.POSITION_AND_AXIS_5D:
        end = line.pose(1.0)
        bent = _bent_problem(model, end, nearest_axis(model, end, at))
        if bent is not None:
            return bent
    return codes.LINE_ENDS()


def nearest_axis(model: RobotModel, pose: FloatArray, near: FloatArray) -> FloatArray:
    """Find joint positions (n,) with the tool at a pose's position, and its axis as near as possible.

    Args:
        near: (n,) start of the descent, which ignores limits.
    """
    positions = near
    for _ in range(_STEPS):
        tool, jacobian = tool_placement(model, positions), tool_jacobian(model, positions)
        axis = tool[:3, 2]
        turn = _turn_of_axis(axis, pose[:3, 2])
        across = np.eye(3) - np.outer(axis, axis)  # ignore the roll about the axis
        rows = np.vstack([jacobian[:3] * _PLACE_WEIGHT, across @ jacobian[3:]])
        off = np.concatenate([(pose[:3, 3] - tool[:3, 3]) * _PLACE_WEIGHT, turn])
        step = np.linalg.lstsq(rows, off, rcond=1e-6)[0]
        positions = positions + step
        if np.abs(step).max() < 1e-9:
            break
    return positions


def _bent_problem(model: RobotModel, pose: FloatArray, positions: FloatArray) -> Reason | None:
    """Return why joint positions do not fit a pose on a line with a deviating axis; None if they do."""
    beyond = violations(model.joints, positions)
    if beyond:
        return codes.JOINTS_OUTSIDE(*beyond)
    away, off = tool_misses(tool_placement(model, positions), pose, Task.POSITION_AND_AXIS_5D)
    if away > LINE_M / 100:
        return codes.LINE_AWAY(distance_mm=away * 1000)
    if off > radians(BENT_DEG):
        return codes.LINE_BENT(limit_deg=BENT_DEG)
    return None
