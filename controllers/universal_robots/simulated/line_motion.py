"""Motion of a script with trapezoidal speed: on a straight line in joint space, or of the tool.

Time is an argument.
"""

import math
from typing import Protocol

import numpy as np

from controllers.universal_robots.simulated.script.errors import ScriptError
from robots.kinematics.inverse import InverseSolver, Task, follow
from robots.kinematics.inverse.tasks import tool_misses
from robots.kinematics.joints import FloatArray
from robots.kinematics.model import RobotModel, tool_placement
from robots.kinematics.motion import ArmState
from robots.programs.lines import Line, UnreachableError, follow_line, line_to

# Between two positions that inverse kinematics computes, and the largest number of them.
_STEP_M, _STEP_RAD = 0.005, 0.02
_MOST_STEPS = 1000
# Largest deviation of the tool from its line.
_OFF_M, _OFF_RAD = 1e-4, 1e-3
NEAR_SINGULAR = "the tool's line is too near a singular position: use movej"
# A joint that does not move at a place of a path [rad per unit].
_STILL = 1e-9


class Path(Protocol):
    """Path of the arm. Places on it are distances from its begin, 0 to `length`."""

    length: float

    def at(self, place: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the positions (n,) [rad] at a place, and their first and second derivatives by it."""


class JointLine:
    """Straight line in joint space; places are angles of the joint that moves farthest [rad].

    Args:
        start, target: (n,) [rad].
    """

    def __init__(self, start: FloatArray, target: FloatArray) -> None:
        way = target - start
        self._start, self._target = start, target
        self.length = float(np.abs(way).max(initial=0.0))
        self._direction = way / self.length if self.length > 0.0 else way

    def at(self, place: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `Path`."""
        positions = self._start + place * self._direction if place < self.length else self._target
        return positions, self._direction, np.zeros_like(positions)


class ToolLine:
    """Straight, uniform motion of the tool: cubic curves of the joints through positions on its line.

    Places are lengths [m], or angles [rad] if the tool turns by more than it moves.

    Args:
        start: (n,) [rad].
        target: (4, 4) tool to base [m].

    Attributes:
        highest_speed: [1/s], at which a joint has its maximum speed.

    Raises:
        ScriptError: If the arm cannot follow the line.
    """

    def __init__(
        self, model: RobotModel, solver: InverseSolver, start: FloatArray, target: FloatArray
    ) -> None:
        line = line_to(tool_placement(model, start), target, Task.POSE_6D)
        turn = float(np.linalg.norm(line.turn))
        self.length = max(line.length_m, turn)
        self._steps = min(2 + int(max(line.length_m / _STEP_M, turn / _STEP_RAD)), _MOST_STEPS)
        positions = [start]
        for step in range(1, self._steps + 1):
            pose = line.pose(step / self._steps)
            found = follow(solver, pose, task=line.task, near=positions[-1])
            if found is None:
                raise _unreachable(model, solver, line, start)
            positions.append(found)
        self._step = max(self.length, _STILL) / self._steps
        begin = np.array(positions)
        slope = np.gradient(begin, axis=0, edge_order=2)
        way, slope, next_slope = np.diff(begin, axis=0), slope[:-1], slope[1:]
        # Hermite's cubic curves, of each step: from power 0 to 3 of the share of the step.
        self._curves = np.stack(
            [begin[:-1], slope, 3 * way - 2 * slope - next_slope, slope + next_slope - 2 * way], axis=1
        )
        for step in range(self._steps):
            middle = tool_placement(model, self._curves[step].T @ (1, 0.5, 0.25, 0.125))
            away, angle = tool_misses(middle, line.pose((step + 0.5) / self._steps), line.task)
            if away > _OFF_M or angle > _OFF_RAD:
                raise ScriptError(NEAR_SINGULAR)
        fastest = np.abs(slope).max(axis=0, initial=0.0) / model.joints.max_speed
        self.highest_speed = self._step / max(float(fastest.max()), _STILL)

    def at(self, place: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `Path`."""
        step = min(int(place / self._step), self._steps - 1)
        share = place / self._step - step
        powers = np.array(
            (
                (1.0, share, share**2, share**3),
                (0.0, 1.0, 2 * share, 3 * share**2),
                (0.0, 0.0, 2.0, 6 * share),
            )
        )
        positions, slope, bend = powers @ self._curves[step]
        return positions, slope / self._step, bend / self._step**2


def _unreachable(model: RobotModel, solver: InverseSolver, line: Line, start: FloatArray) -> ScriptError:
    try:
        follow_line(model, solver, line, start)
    except UnreachableError as error:
        return ScriptError(f"the tool cannot follow the line: {error.reason.text}")
    return ScriptError(NEAR_SINGULAR)


class PathMotion:
    """Motion on a path, from rest to rest.

    Args:
        speed, acceleration: In the path's unit, each above 0; infinite acceleration: no ramps.
        scale: Fraction of the speed that the speed slider permits, above 0.
        place: Where it begins.
    """

    def __init__(
        self,
        path: Path,
        *,
        speed: float,
        acceleration: float,
        now_s: float,
        scale: float = 1.0,
        place: float = 0.0,
    ) -> None:
        self._path, self._speed, self._acceleration = path, speed, acceleration
        self._at_s, self._path_s, self._scale = now_s, 0.0, scale
        left = path.length - place
        # Phases of constant acceleration: duration and acceleration.
        if acceleration == math.inf:
            self._begin, self._phases = (place, speed), [(left / speed, 0.0)]
        else:
            peak = min(speed, math.sqrt(acceleration * left))
            ramp_s = peak / acceleration
            cruise_s = max(0.0, left / peak - ramp_s) if peak > 0.0 else 0.0
            self._begin = (place, 0.0)
            self._phases = [(ramp_s, acceleration), (cruise_s, 0.0), (ramp_s, -acceleration)]
        self.braking = False

    def resumed(self, now_s: float, scale: float) -> "PathMotion":
        """Return the motion on the rest of the path, from rest."""
        speed, acceleration = self._speed, self._acceleration
        place = min(self._on_path(now_s)[0], self._path.length)
        return PathMotion(
            self._path, speed=speed, acceleration=acceleration, now_s=now_s, scale=scale, place=place
        )

    def scale(self, scale: float, now_s: float) -> None:
        """Change the fraction of the speed."""
        if not self.braking:
            self._path_s, self._at_s, self._scale = self._path_time(now_s), now_s, scale

    def brake(self, deceleration: float, now_s: float, *, of_joints: bool) -> None:
        """Come to rest on the path, at its end at the latest.

        Args:
            deceleration: Of the leading joint [rad/s²], or in the path's unit.
        """
        place, rate, _ = self._on_path(now_s)
        if of_joints:
            deceleration /= max(float(np.abs(self._path.at(place)[1]).max()), _STILL)
        deceleration = max(deceleration, rate**2 / (2.0 * max(self._path.length - place, _STILL)))
        self._begin = (place, rate)
        self._phases = [(rate / deceleration, -deceleration)]
        self._at_s, self._path_s, self._scale = now_s, 0.0, 1.0
        self.braking = True

    def moving(self, now_s: float) -> bool:
        """Return whether it has not ended."""
        return self._path_time(now_s) < sum(duration for duration, _ in self._phases)

    def state(self, now_s: float) -> ArmState:
        """Return positions, velocities and accelerations."""
        place, rate, change = self._on_path(now_s)
        if not self.braking and not self.moving(now_s):
            place = self._path.length
        positions, slope, bend = self._path.at(min(place, self._path.length))
        return ArmState(positions, rate * slope, change * slope + rate**2 * bend)

    def _path_time(self, now_s: float) -> float:
        return self._path_s + (now_s - self._at_s) * self._scale

    def _on_path(self, now_s: float) -> tuple[float, float, float]:
        """Return the place, its rate [1/s] and the rate's change [1/s²]."""
        left_s = max(0.0, self._path_time(now_s))
        place, rate = self._begin
        for duration_s, change in self._phases:
            time_s = min(left_s, duration_s)
            place, rate = place + rate * time_s + change * time_s**2 / 2.0, rate + change * time_s
            left_s -= time_s
            if left_s <= 0.0:
                return place, rate * self._scale, change * self._scale**2
        return place, 0.0, 0.0


def speed_for(length: float, acceleration: float, time_s: float) -> tuple[float, float]:
    """Return speed [1/s] and acceleration [1/s²] of a motion on a path that takes a time [s]."""
    rest = (acceleration * time_s) ** 2 - 4.0 * acceleration * length
    if rest < 0.0:
        return 2.0 * length / time_s, 4.0 * length / time_s**2
    return (acceleration * time_s - math.sqrt(rest)) / 2.0, acceleration
