"""A straight line of the tool, cut into joint moves that keep to it."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import radians

import numpy as np

from robots.inverse import InverseSolver, Task, follow, solve
from robots.inverse.tasks import tool_misses
from robots.joints import FloatArray, violations
from robots.model import RobotModel, tool_jacobian, tool_placement
from robots.poses import axis_rotation
from robots.programs.steps import LINE_DEG, LINE_M

# Between those the tool is looked at, of each joint move; and so much is kept in hand for what lies between.
_LOOKS = (0.25, 0.5, 0.75)
_IN_HAND = 0.9
# Halving a line so often ends below 0.1 mm for lines of up to 1.6 m: what cannot be followed there is a jump.
_MOST_HALVINGS = 14
# How far an arm of five joints may hold its tool's axis from an even turn between a line's ends.
BENT_DEG = 15.0
# Its search: steps, and what a metre from the line weighs in radians of the axis.
_STEPS = 12
_PLACE_WEIGHT = 1000.0


class UnreachableError(Exception):
    """A place that the arm cannot get to.

    Attributes:
        reason: Why, in words.
        place: (3,) where in the base frame [m].
        done_m: How far along the line.
    """

    def __init__(self, reason: str, place: FloatArray, done_m: float) -> None:
        self.reason, self.place, self.done_m = reason, place, done_m
        super().__init__(reason)


@dataclass(frozen=True, eq=False)
class Line:
    """A tool's way: its origin straight and evenly, turning about one axis, evenly too.

    Attributes:
        begin: (4, 4) tool to base [m].
        way: (3,) [m].
        turn: (3,) axis times angle [rad], in the base frame.
        task: Of the tool, what counts.
    """

    begin: FloatArray
    way: FloatArray
    turn: FloatArray
    task: Task

    @property
    def length_m(self) -> float:
        """Of the origin's way."""
        return float(np.linalg.norm(self.way))

    def pose(self, share: float) -> FloatArray:
        """(4, 4) where the tool is to be at a share of the way, 0 to 1."""
        pose = self.begin.copy()
        pose[:3, 3] += share * self.way
        pose[:3, :3] = axis_rotation(self.turn, share * float(np.linalg.norm(self.turn))) @ pose[:3, :3]
        return pose

    def share_of(self, tool: FloatArray, otherwise: float) -> float:
        """The share of the way that a tool (4, 4) is abreast of; otherwise, where there is no way to go."""
        if self.length_m < 1e-6:
            return otherwise
        along = float((tool[:3, 3] - self.begin[:3, 3]) @ self.way) / self.length_m**2
        return min(max(along, 0.0), 1.0)


def line_to(begin: FloatArray, end: FloatArray, task: Task) -> Line:
    """The line from one pose of the tool to another; of five-dimensional tasks the roll does not count."""
    if task is Task.POSITION_AND_AXIS_5D:
        turn = _turn_of_axis(begin[:3, 2], end[:3, 2])
    else:
        turn = _turn(end[:3, :3] @ begin[:3, :3].T)
    return Line(begin, end[:3, 3] - begin[:3, 3], turn, task)


def _turn_of_axis(one: FloatArray, other: FloatArray) -> FloatArray:
    """The shortest turn (3,) of one direction to another [rad]."""
    across = np.cross(one, other)
    sine = float(np.linalg.norm(across))
    angle = float(np.arctan2(sine, one @ other))
    if sine < 1e-9:
        # Right about: any axis across will do.
        across = np.cross(one, np.eye(3)[int(np.abs(one).argmin())])
        sine = float(np.linalg.norm(across))
    turn: FloatArray = across / sine * angle
    return turn


def _turn(rotation: FloatArray) -> FloatArray:
    """Axis times angle (3,) of a (3, 3) rotation [rad]."""
    vector = np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    sine = float(np.linalg.norm(vector)) / 2
    angle = float(np.arctan2(sine, (np.trace(rotation) - 1) / 2))
    if sine > 1e-6:
        turned: FloatArray = vector / (2 * sine) * angle
        return turned
    # Next to no turn, or half a one: then the axis is what the rotation leaves as it is.
    column = np.eye(3) + rotation
    axis = column[:, int(np.linalg.norm(column, axis=0).argmax())]
    half: FloatArray = axis / np.linalg.norm(axis) * angle
    return half


@dataclass(frozen=True, eq=False)
class Followed:
    """A line as joint moves.

    Attributes:
        ends: Where each move ends, (n,) [rad] or [m]; the last at the line's end.
        bent_rad: How far the tool's axis leaves its even turn, for the arm cannot hold it there.
    """

    ends: tuple[FloatArray, ...]
    bent_rad: float = 0.0


def follow_line(model: RobotModel, solver: InverseSolver, line: Line, start: FloatArray) -> Followed:
    """The joint moves that stand for a line.

    An arm of five joints can hold its tool's axis only some ways at each place: between the line's ends the
    axis then stands as near to where an even turn has it as the arm gets, up to BENT_DEG from there.

    Args:
        start: (n,) joint positions at its beginning.

    Raises:
        UnreachableError: If the arm cannot get to the end, or would have to jump to another posture.
    """
    for bent in (False, True) if line.task is Task.POSITION_AND_AXIS_5D else (False,):
        follower = _Follower(model, solver, line, bent=bent)
        try:
            return Followed(tuple(follower.ends(start)), follower.bent_rad)
        except _StuckError as error:
            stuck = error
    raise _unreachable(model, solver, line, stuck)


class _StuckError(Exception):
    """No joint move leads on from a share of the line, where the arm is at some positions."""

    def __init__(self, begin: float, end: float, at: FloatArray) -> None:
        self.begin, self.end, self.at = begin, end, at
        super().__init__()


class _Follower:
    def __init__(self, model: RobotModel, solver: InverseSolver, line: Line, *, bent: bool) -> None:
        self.bent_rad = 0.0
        self._model, self._solver, self._line, self._bent = model, solver, line, bent

    def ends(self, start: FloatArray) -> Iterator[FloatArray]:
        """Cut by halves until each part keeps to the line."""
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
        """Joint positions at a share of the line, on the branch of those near; None: there are none."""
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
        """Whether the tool stays by the line on a straight joint motion."""
        for look in _LOOKS:
            positions = one + look * (other - one)
            tool = tool_placement(self._model, positions)
            wanted = self._line.pose(self._line.share_of(tool, begin + look * (end - begin)))
            if self._bent:
                wanted = tool_placement(self._model, nearest_axis(self._model, wanted, positions))
            away, angle = tool_misses(tool, wanted, self._line.task)
            if away > LINE_M * _IN_HAND or angle > radians(LINE_DEG) * _IN_HAND:
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
) -> str:
    """Why the arm does not get to a pose of the line."""
    end = solve(solver, line.pose(1.0), task=line.task, near=stuck.at)
    if not len(end.solutions):
        return f"its end cannot be reached: {end.reason}"
    result = solve(solver, pose, task=line.task, near=stuck.at)
    if len(result.solutions):
        leaps = np.abs(result.solutions[0] - stuck.at) / (model.joints.upper - model.joints.lower)
        first = model.joints.names[int(leaps.argmax())]
        return f"the arm would have to jump to another posture there, joint {first} most of all"
    if line.task is Task.POSITION_AND_AXIS_5D:
        bent = _bent_problem(model, pose, nearest_axis(model, pose, stuck.at))
        return bent or result.reason
    return result.reason


def nearest_axis(model: RobotModel, pose: FloatArray, near: FloatArray) -> FloatArray:
    """Joint positions (n,) that have the tool at a place, its axis as near to the pose's as the arm gets.

    Args:
        near: (n,) where to begin; the answer is what can be walked to from there, limits or not.
    """
    positions = near
    for _ in range(_STEPS):
        tool, jacobian = tool_placement(model, positions), tool_jacobian(model, positions)
        axis = tool[:3, 2]
        turn = _turn_of_axis(axis, pose[:3, 2])
        across = np.eye(3) - np.outer(axis, axis)  # a roll about the axis turns no axis
        rows = np.vstack([jacobian[:3] * _PLACE_WEIGHT, across @ jacobian[3:]])
        off = np.concatenate([(pose[:3, 3] - tool[:3, 3]) * _PLACE_WEIGHT, turn])
        step = np.linalg.lstsq(rows, off, rcond=1e-6)[0]
        positions = positions + step
        if np.abs(step).max() < 1e-9:
            break
    return positions


def _bent_problem(model: RobotModel, pose: FloatArray, positions: FloatArray) -> str:
    """Why joint positions will not do for a pose on a line with the axis bent; or nothing."""
    beyond = violations(model.joints, positions)
    if beyond:
        return "; ".join(map(str, beyond))
    away, off = tool_misses(tool_placement(model, positions), pose, Task.POSITION_AND_AXIS_5D)
    if away > LINE_M / 100:
        return f"the tool gets no nearer than {away * 1000:.1f} mm from here"
    if off > radians(BENT_DEG):
        return f"the arm cannot hold its tool's axis within {BENT_DEG:g}° of an even turn there"
    return ""
