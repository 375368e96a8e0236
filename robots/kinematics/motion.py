"""Jerk-limited motion of all joints, as a function of time, for the simulated controller.

A motion is planned once and then sampled, so a late tick causes no error. From rest to rest it is a straight
line in joint space. It stays on this line, which may have been collision-checked, when its speed changes,
when it brakes and when it resumes. A new plan during a motion starts from the old plan's current position,
velocity and acceleration, so no command makes the arm jump.
Time is an argument: seconds of any monotonic clock.
"""

from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import numpy as np
import ruckig

from robots.kinematics.joints import FloatArray, Joints
from robots.kinematics.straight_motion import Limits, StraightMotion, line_limits, straight_motion

# State on a line: position, velocity, acceleration.
_Values: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class ArmState:
    """Positions, velocities and accelerations of the joints; each (n,) in rad or m, and seconds."""

    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray


class _Trajectory(Protocol):
    """A planned motion; time counts from its start."""

    @property
    def duration(self) -> float: ...

    def at_time(self, time_s: float) -> Any: ...


def _plan_on_line(
    joints: Joints,
    start: FloatArray,
    target: FloatArray,
    begin: _Values,
    *,
    speed: float | None,
) -> StraightMotion:
    """Plan a motion on a line to its target, or to rest.

    Args:
        begin: Completed share of the way, its rate [1/s] and its acceleration [1/s²].
        speed: Fraction of the joints' maximum speeds; None to brake.
    """
    length, limits = line_limits(joints, start, target, speed or 1.0)
    at = begin[0] * length, begin[1] * length, begin[2] * length
    parts = [_plan_to_speed(at, 0.0, limits)] if speed is None else _plan_to_position(at, length, limits)
    end = (
        target
        if speed is not None
        else start + min(_final_state(parts[0])[0] / length, 1.0) * (target - start)
    )
    phases = np.concatenate([_phases(part) for part in parts])
    begins = np.concatenate([[0.0], np.cumsum(phases[:-1, 0])])
    duration = sum(part.duration for part in parts)
    return StraightMotion(start, target, end, duration, begins, phases[:, 1:] / length)


def _plan_to_position(at: _Values, place: float, limits: Limits) -> list[Any]:
    """Return consecutive trajectories of one value, to rest at a position ahead."""
    _, velocity, acceleration = at
    fastest, quickest, sharpest = limits
    peak = velocity + max(acceleration, 0.0) ** 2 / (2 * sharpest)
    first = []
    if peak > fastest:
        # Above the speed limit, ruckig alone would brake so hard that the motion reverses for a moment.
        slowed = _plan_to_speed(at, fastest, limits)
        if _final_state(_plan_to_speed(_final_state(slowed), 0.0, limits))[0] <= place:
            first, at = [slowed], _final_state(slowed)
        else:
            # Near its target, the motion brakes anyway.
            fastest = peak
    request = _request_from(at, (fastest, quickest, sharpest))
    request.target_position = [place]
    return [*first, _calculate(ruckig.Ruckig(1), request)]


def _plan_to_speed(at: _Values, speed: float, limits: Limits) -> Any:
    """Return a trajectory of one value to a speed."""
    request = _request_from(at, limits)
    request.control_interface = ruckig.ControlInterface.Velocity
    request.target_velocity = [speed]
    return _calculate(ruckig.Ruckig(1), request)


def _request_from(at: _Values, limits: Limits) -> ruckig.InputParameter:
    request = ruckig.InputParameter(1)
    request.current_position, request.current_velocity, request.current_acceleration = ([x] for x in at)
    request.max_velocity, request.max_acceleration, request.max_jerk = ([x] for x in limits)
    return request


def _final_state(trajectory: Any) -> _Values:
    (place,), (velocity,), (acceleration,) = trajectory.at_time(trajectory.duration)
    return place, velocity, acceleration


def _phases(trajectory: Any) -> FloatArray:
    """Return the (9, 5) of a trajectory's phases: duration, position, velocity, acceleration and jerk."""
    profile = trajectory.profiles[0][0]
    # Ruckig has seven phases, after two that bring an initial state beyond a limit back within it.
    first = profile.brake
    return np.array([[*getattr(first, name), *getattr(profile, name)[:7]] for name in "tpvaj"]).T


def _calculate(planner: Any, request: Any) -> Any:
    trajectory = ruckig.Trajectory(planner.degrees_of_freedom)
    result = planner.calculate(request, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise AssertionError(f"no motion can be planned: {result}")
    return trajectory


class Motion:
    """Motion of one arm, initially at rest.

    Args:
        positions: (n,) initial positions [rad] or [m].
    """

    def __init__(self, joints: Joints, positions: FloatArray) -> None:
        self._joints = joints
        self._planner = ruckig.Ruckig(len(joints))
        self._trajectory: _Trajectory | None = None
        self._begin_s = 0.0
        self._end = self._at_rest(positions)

    def state(self, now_s: float) -> ArmState:
        """Return the arm's state at a time after the last plan's start."""
        if self._trajectory is None or now_s >= self.end_s:
            return self._end
        sample = self._trajectory.at_time(max(now_s - self._begin_s, 0.0))
        return ArmState(*(np.array(values, dtype=np.float64) for values in sample))

    @property
    def end_s(self) -> float:
        """Time at which the arm is at rest."""
        return self._begin_s + (self._trajectory.duration if self._trajectory is not None else 0.0)

    def moving(self, now_s: float) -> bool:
        """Return whether the arm is still moving."""
        return now_s < self.end_s

    def move(self, target: FloatArray, now_s: float, *, speed: float) -> None:
        """Move to a target and stop there; all joints arrive at the same time.

        Args:
            target: (n,) [rad] or [m], within the limits.
            speed: Fraction of the joints' maximum speeds, in (0, 1].
        """
        line = self._trajectory
        if not self.moving(now_s):
            self._follow(
                straight_motion(self._joints, self._end.positions, target, speed=speed), now_s, target
            )
            return
        if isinstance(line, StraightMotion) and np.array_equal(line.target, target):
            self._follow(self._replanned(line, now_s, speed), now_s, target)
            return
        request = self._request(now_s, speed)
        request.target_position = target.tolist()
        request.synchronization = ruckig.Synchronization.Phase
        self._follow(_calculate(self._planner, request), now_s, target)

    def brake(self, now_s: float) -> None:
        """Brake as fast as acceleration and jerk limits allow; a straight motion stays on its line."""
        line = self._trajectory
        if isinstance(line, StraightMotion) and self.moving(now_s):
            braked = self._replanned(line, now_s, None)
            self._follow(braked, now_s, braked.end)
            return
        request = self._request(now_s, 1.0)
        request.control_interface = ruckig.ControlInterface.Velocity
        trajectory = _calculate(self._planner, request)
        end = trajectory.at_time(trajectory.duration)[0]
        self._follow(trajectory, now_s, np.array(end, dtype=np.float64))

    def _replanned(self, line: StraightMotion, now_s: float, speed: float | None) -> StraightMotion:
        """Return the motion from now to the line's target, at another speed; None: to rest, on the line."""
        at = line.share_at(np.float64(now_s - self._begin_s))
        return _plan_on_line(self._joints, line.start, line.target, at, speed=speed)

    def _request(self, now_s: float, speed: float) -> ruckig.InputParameter:
        state = self.state(now_s)
        request = ruckig.InputParameter(len(self._joints))
        request.current_position = state.positions.tolist()
        request.current_velocity = state.velocities.tolist()
        request.current_acceleration = state.accelerations.tolist()
        request.max_velocity = (self._joints.max_speed * speed).tolist()
        request.max_acceleration = self._joints.max_acceleration.tolist()
        request.max_jerk = self._joints.max_jerk.tolist()
        return request

    def _follow(self, trajectory: _Trajectory | None, now_s: float, end: FloatArray) -> None:
        # The planner's sums are off by a few 1e-15, so the requested end is the final state.
        self._trajectory, self._begin_s = trajectory, now_s
        self._end = self._at_rest(end)

    def _at_rest(self, positions: FloatArray) -> ArmState:
        return ArmState(positions, np.zeros(len(self._joints)), np.zeros(len(self._joints)))
