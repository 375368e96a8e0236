"""Functions of scripts that move the arm or compute its poses."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from controllers.universal_robots.simulated.line_motion import (
    NEAR_SINGULAR,
    JointLine,
    Path,
    ToolLine,
    speed_for,
)
from controllers.universal_robots.simulated.script.errors import ScriptError
from controllers.universal_robots.simulated.script.machine import Machine, Pose, Value, Wait, text_of
from robots.kinematics.inverse import Task, solve, tool_pose
from robots.kinematics.joints import FloatArray, violations
from robots.kinematics.model import link_placements, tool_jacobian, tool_placement
from robots.schema.errors import PoseError
from robots.schema.poses import axis_rotation, inverse, rotation_vector

if TYPE_CHECKING:
    from controllers.universal_robots.simulated.controller import UrController

JOINTS = 6
STEP_S = 0.01
"""Period of a tick."""
# A motion by speeds ends unless it is renewed within this time.
_HELD_S = 0.1
_SHORTEST = 1e-9
# Smallest singular value of a Jacobian by which speeds are computed, of its largest.
_SINGULAR = 1e-3


class MotionFunctions:
    """Functions of motion; their names are those of the script language."""

    def __init__(self, controller: "UrController") -> None:
        self._controller = controller
        self._programs = controller.programs

    def movej(
        self,
        machine: Machine,
        thread: int,
        q: Value,
        a: Value = 1.4,
        v: Value = 1.05,
        t: Value = 0.0,
        r: Value = 0.0,
    ) -> Value:
        """Move on a straight line in joint space; r is not simulated."""
        self._need_arm(machine)
        start = self._programs.arm(machine.now_s).positions
        target = self._solution(q, start) if isinstance(q, Pose) else np.array(vector(q))
        self._check(target)
        return self._move(machine, thread, JointLine(start, target), (a, v, t, r), np.inf)

    def movel(
        self,
        machine: Machine,
        thread: int,
        pose: Value,
        a: Value = 1.2,
        v: Value = 0.25,
        t: Value = 0.0,
        r: Value = 0.0,
    ) -> Value:
        """Move the tool on a straight line, to a pose or that of joint positions; r is not simulated."""
        self._need_arm(machine)
        start = self._programs.arm(machine.now_s).positions
        goal = pose if isinstance(pose, Pose) else self.get_forward_kin(machine, thread, pose)
        path = ToolLine(self._controller.model, self._controller.solver, start, _placement(goal))
        return self._move(machine, thread, path, (a, v, t, r), path.highest_speed)

    def servoj(
        self,
        machine: Machine,
        thread: int,
        q: Value,
        a: Value = 0.0,
        v: Value = 0.0,
        t: Value = 0.002,
        lookahead_time: Value = 0.1,
        gain: Value = 300.0,
    ) -> Value:
        """Follow joint positions, late by the lookahead time; a, v and gain have no effect."""
        self._need_arm(machine)
        target = np.array(vector(q))
        self._check(target)
        way = target - self._programs.arm(machine.now_s).positions
        soonest_s = float(np.abs(way / self._controller.joints.max_speed).max())
        self._steer(thread, way, max(positive(lookahead_time), soonest_s), machine.now_s)
        end_s = machine.now_s + number(t)
        return Wait(lambda now_s: (None,) if now_s >= end_s else None)

    def speedj(self, machine: Machine, thread: int, qd: Value, a: Value = 1.4, t: Value = 0.0) -> Value:
        """Accelerate the joints to speeds and keep them; without t until they have these speeds."""
        return self._speed(machine, thread, vector(qd), a, t, lambda positions: np.eye(JOINTS))

    def speedl(
        self,
        machine: Machine,
        thread: int,
        xd: Value,
        a: Value = 0.5,
        t: Value = 0.0,
        aRot: Value = 0.0,  # noqa: N803 - the script language's name
    ) -> Value:
        """Accelerate the tool to speeds, and keep them; without t until it has them; aRot is a."""
        return self._speed(machine, thread, vector(xd), a, t, self._jacobian)

    def stopj(self, machine: Machine, thread: int, a: Value = 2.0) -> Value:
        """Brake to rest; a is that of the leading joint [rad/s²]."""
        return self._stop(machine, thread, a, of_joints=True)

    def stopl(self, machine: Machine, thread: int, a: Value = 20.0) -> Value:
        """Brake to rest; a is that of the tool on its line [m/s²]."""
        return self._stop(machine, thread, a, of_joints=False)

    def is_steady(self, machine: Machine, thread: int) -> Value:
        """Return whether the arm has rested for half a second."""
        return self._programs.steady(machine.now_s)

    # ------------------------------------------------------------------- poses

    def get_inverse_kin(
        self, machine: Machine, thread: int, x: Value, qnear: Value = None, *tolerances: Value
    ) -> Value:
        """Return the joint positions of a pose nearest to others; the tolerances have no effect."""
        near = self._programs.arm(machine.now_s).positions if qnear is None else np.array(vector(qnear))
        return tuple(self._solution(x, near).tolist())

    def get_inverse_kin_has_solution(self, machine: Machine, thread: int, *given: Value) -> Value:
        """Return whether there are joint positions of a pose."""
        try:
            return bool(self.get_inverse_kin(machine, thread, *given))
        except ScriptError:
            return False

    def get_forward_kin(self, machine: Machine, thread: int, q: Value = None, tcp: Value = None) -> Value:
        """Return the tool's pose at joint positions, without them at the arm's; tcp: that of another tool."""
        positions = self._programs.arm(machine.now_s).positions if q is None else np.array(vector(q))
        if tcp is not None:
            return pose_of(link_placements(self._controller.model, positions)[-1] @ _placement(tcp))
        return pose_of(tool_placement(self._controller.model, positions))

    def is_within_safety_limits(self, machine: Machine, thread: int, pose: Value) -> Value:
        """Return whether the arm can be at a pose, or at joint positions."""
        if isinstance(pose, Pose):
            return self.get_inverse_kin_has_solution(machine, thread, pose)
        return not violations(self._controller.joints, vector(pose))

    def pose_trans(self, machine: Machine, thread: int, p_from: Value, p_from_to: Value) -> Value:
        """Return the second pose, which is given in the frame of the first one."""
        return pose_of(_placement(p_from) @ _placement(p_from_to))

    def pose_inv(self, machine: Machine, thread: int, p_from: Value) -> Value:
        """Return the inverse of a pose."""
        return pose_of(inverse(_placement(p_from)))

    def pose_sub(self, machine: Machine, thread: int, p_to: Value, p_from: Value) -> Value:
        """Return the difference of two poses, position and rotation each along the base's axes."""
        to, from_ = _placement(p_to), _placement(p_from)
        to[:3, 3] -= from_[:3, 3]
        to[:3, :3] = to[:3, :3] @ from_[:3, :3].T
        return pose_of(to)

    # ------------------------------------------------------------------ motion

    def _move(
        self, machine: Machine, thread: int, path: Path, given: tuple[Value, ...], highest_speed: float
    ) -> Wait:
        """Begin a motion on a path with a script's a, v, t and r."""
        acceleration, speed, time_s = (positive(each) for each in (*given[:2], given[2] or 1.0))
        if number(given[3]) != 0.0:
            raise ScriptError("a blend radius is not simulated: r must be 0")
        if given[2]:
            speed, acceleration = speed_for(max(path.length, _SHORTEST), acceleration, time_s)
        self._programs.begin_move(
            thread,
            path,
            speed=min(speed, highest_speed),
            acceleration=acceleration,
            now_s=machine.now_s,
        )
        return Wait(self._arrived)

    def _steer(self, thread: int, way: FloatArray, time_s: float, now_s: float) -> None:
        """Move by a way [rad] in a time, without a ramp."""
        start = self._programs.arm(now_s).positions
        path = JointLine(start, start + way)
        speed = max(path.length / time_s, _SHORTEST)
        self._programs.begin_move(thread, path, speed=speed, acceleration=math.inf, now_s=now_s)

    def _speed(
        self,
        machine: Machine,
        thread: int,
        wanted: tuple[float, ...],
        a: Value,
        t: Value,
        jacobian_at: Callable[[FloatArray], FloatArray],
    ) -> Wait:
        """Accelerate to speeds of joints or tool, and keep them in each tick."""
        self._need_arm(machine)
        most, end_s = positive(a) * STEP_S, machine.now_s + number(t)

        def go_on(now_s: float) -> tuple[Value] | None:
            arm = self._programs.arm(now_s)
            jacobian = jacobian_at(arm.positions)
            speeds = jacobian @ arm.velocities
            change = np.array(wanted) - speeds
            left = float(np.abs(change).max())
            if now_s >= end_s and (t or left < _SHORTEST):
                return (None,)
            speeds += change * min(1.0, most / max(left, _SHORTEST))
            velocities = np.linalg.pinv(jacobian, rcond=_SINGULAR) @ speeds
            if np.abs(jacobian @ velocities - speeds).max() > _SHORTEST:
                raise ScriptError(NEAR_SINGULAR)
            velocities /= max(1.0, float(np.abs(velocities / self._controller.joints.max_speed).max()))
            self._check(arm.positions + velocities * _HELD_S)
            self._steer(thread, velocities * _HELD_S, _HELD_S, now_s)
            return None

        go_on(machine.now_s)
        return Wait(go_on)

    def _jacobian(self, positions: FloatArray) -> FloatArray:
        return tool_jacobian(self._controller.model, positions)

    def _stop(self, machine: Machine, thread: int, a: Value, *, of_joints: bool) -> Wait:
        self._need_arm(machine)
        self._programs.take_arm(thread)
        self._programs.brake(positive(a), machine.now_s, of_joints=of_joints)
        return Wait(self._arrived)

    def _need_arm(self, machine: Machine) -> None:
        if not self._programs.is_running(machine):
            raise ScriptError("a secondary program cannot move the arm")

    def _arrived(self, now_s: float) -> tuple[Value] | None:
        if self._programs.moving(now_s):
            return None
        self._programs.release_arm()
        return (None,)

    def _check(self, target: FloatArray) -> None:
        if outside := violations(self._controller.joints, target):
            raise ScriptError(f"target outside the joint limits: {outside[0]}")

    def _solution(self, pose: Value, near: FloatArray) -> FloatArray:
        """Return the joint positions of a pose that are nearest to others."""
        result = solve(self._controller.solver, _placement(pose), task=Task.POSE_6D, near=near)
        if result.reason is not None:
            raise ScriptError(f"the pose cannot be reached: {result.reason.text}")
        positions: FloatArray = result.solutions[0]
        return positions


def number(value: Value) -> float:
    """Return a finite number.

    Raises:
        ScriptError: If the value is none.
    """
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ScriptError(f"expected a number, not {text_of(value)[:40]}")
    return float(value)


def positive(value: Value) -> float:
    """Return a number above 0.

    Raises:
        ScriptError: If the value is none.
    """
    if number(value) <= 0.0:
        raise ScriptError(f"expected a number above 0, not {value:g}")
    return float(value)


def vector(value: Value) -> tuple[float, ...]:
    """Return six numbers.

    Raises:
        ScriptError: If the value is not a list, or a pose, of six.
    """
    if not isinstance(value, tuple) or len(value) != JOINTS:
        raise ScriptError("expected a list of six numbers")
    return tuple(number(each) for each in value)


def _placement(pose: Value) -> FloatArray:
    """Return the (4, 4) of a pose: position [m], rotation vector [rad]."""
    values = np.array(vector(pose))
    placement = np.eye(4)
    placement[:3, :3] = axis_rotation(values[3:], float(np.linalg.norm(values[3:])))
    placement[:3, 3] = values[:3]
    try:
        return tool_pose(placement)
    except PoseError as error:
        raise ScriptError(str(error)) from None


def pose_of(placement: FloatArray) -> Pose:
    """Return a (4, 4) placement as a pose."""
    return Pose((*placement[:3, 3].tolist(), *rotation_vector(placement[:3, :3]).tolist()))
