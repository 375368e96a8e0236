"""Jerk-limited motion of all joints, as a function of time.

A motion is planned once and then only sampled, so that a late tick makes no error. From rest to rest
it is a straight line between the joint positions, always, and it stays on that line, which may have been
checked, when its speed is changed, when it brakes and when it goes on. A new plan in mid-motion begins where
the old one is at that moment, in position, speed and acceleration: no command makes the arm jump.
Time is an argument: seconds on any clock that does not go back.
"""

from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import numpy as np
import ruckig

from robots.joints import FloatArray, Joints

# Homing is slow, because nothing is known yet; at its end the marks are looked for.
HOMING_SPEED = 0.5
HOMING_REST_S = 0.5

# Of what moves along a line: place, velocity, acceleration; or the limits: velocity, acceleration, jerk.
_Values: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class ArmState:
    """Where the joints are, and how they move; each (n,) in rad or m, and seconds."""

    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray


class _Trajectory(Protocol):
    """A planned motion; time counts from its beginning."""

    @property
    def duration(self) -> float: ...

    def at_time(self, time_s: float) -> Any: ...


@dataclass(frozen=True, eq=False)
class StraightMotion:
    """Straight from one set of joint positions to another, or on that line until it has come to rest.

    One profile moves all joints, as fast as the limit allows that is met first. Ruckig's own motion in
    phase leaves the straight line, without a word, where the joint that takes longest would ask another
    for more than it may do; a line that is checked must be the line that is driven.

    Attributes:
        start, target: (n,) the line's ends [rad] or [m].
        end: (n,) where it comes to rest: at the target, unless it brakes.
        duration: [s]
    """

    start: FloatArray
    target: FloatArray
    end: FloatArray
    duration: float
    _joints: Joints
    # Of ruckig's phases: when each begins, and the share of the way, its rates and its jerk then.
    _times: FloatArray
    _shares: FloatArray

    def progress(self, times_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The share of the way that is done at times (m,), 0 to 1, and its rate [1/s]."""
        share, rate, _ = self._at(times_s)
        return np.clip(share, 0.0, 1.0), rate

    def at_time(self, time_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(n,) positions, velocities and accelerations at a time from its beginning."""
        share, rate, curvature = self._at(np.float64(time_s))
        way = self.target - self.start
        return self.start + share * way, rate * way, curvature * way

    def at_speed(self, time_s: float, speed: float) -> "StraightMotion":
        """On to the target from where it is at a time, at another speed."""
        return _along(self._joints, self.start, self.target, self._at(np.float64(time_s)), speed=speed)

    def braked(self, time_s: float) -> "StraightMotion":
        """To rest from where it is at a time, as fast as accelerations and jerks allow."""
        return _along(self._joints, self.start, self.target, self._at(np.float64(time_s)), speed=None)

    def _at(self, times_s: Any) -> tuple[Any, Any, Any]:
        phase = np.clip(np.searchsorted(self._times, times_s, side="right") - 1, 0, len(self._times) - 1)
        t = np.clip(times_s, 0.0, self.duration) - self._times[phase]
        s, v, a, j = self._shares[phase].T
        return s + t * (v + t * (a / 2 + t * j / 6)), v + t * (a + t * j / 2), a + t * j


def straight_motion(
    joints: Joints, start: FloatArray, target: FloatArray, *, speed: float
) -> StraightMotion | None:
    """The motion from rest at one place to rest at another; None where they are the same.

    Args:
        start, target: (n,) [rad] or [m].
        speed: Fraction of the joints' greatest speeds, above 0 to 1.
    """
    if np.array_equal(start, target):
        return None
    return _along(joints, start, target, (0.0, 0.0, 0.0), speed=speed)


def _along(
    joints: Joints,
    start: FloatArray,
    target: FloatArray,
    begin: _Values,
    *,
    speed: float | None,
) -> StraightMotion:
    """On a line to its target, or to rest.

    Args:
        begin: The share of the way that is done, its rate [1/s] and the rate's rate [1/s²].
        speed: Fraction of the joints' greatest speeds; None: it brakes.
    """
    way = np.abs(target - start)
    moving = way > 0
    # Counted in the way of the joint that goes farthest: numbers of the joints' own size.
    length = float(way.max())
    fastest, quickest, sharpest = (
        float((limit[moving] * (length / way[moving])).min())
        for limit in (joints.max_speed * (speed or 1.0), joints.max_acceleration, joints.max_jerk)
    )
    at, limits = (begin[0] * length, begin[1] * length, begin[2] * length), (fastest, quickest, sharpest)
    parts = [_to_speed(at, 0.0, limits)] if speed is None else _to_place(at, length, limits)
    end = target if speed is not None else start + min(_last(parts[0])[0] / length, 1.0) * (target - start)
    phases = np.concatenate([_phases(part) for part in parts])
    begins = np.concatenate([[0.0], np.cumsum(phases[:-1, 0])])
    duration = sum(part.duration for part in parts)
    return StraightMotion(start, target, end, duration, joints, begins, phases[:, 1:] / length)


def _to_place(at: _Values, place: float, limits: _Values) -> list[Any]:
    """Trajectories of one number, one after the other, to rest at a place ahead."""
    _, velocity, acceleration = at
    fastest, quickest, sharpest = limits
    peak = velocity + max(acceleration, 0.0) ** 2 / (2 * sharpest)
    first = []
    if peak > fastest:
        # Ruckig would slow it down until it goes back, for a moment.
        slowed = _to_speed(at, fastest, limits)
        if _last(_to_speed(_last(slowed), 0.0, limits))[0] <= place:
            first, at = [slowed], _last(slowed)
        else:
            # So near its target it is slowed down for that anyway.
            fastest = peak
    request = _from(at, (fastest, quickest, sharpest))
    request.target_position = [place]
    return [*first, _planned(ruckig.Ruckig(1), request)]


def _to_speed(at: _Values, speed: float, limits: _Values) -> Any:
    """A trajectory of one number to a speed."""
    request = _from(at, limits)
    request.control_interface = ruckig.ControlInterface.Velocity
    request.target_velocity = [speed]
    return _planned(ruckig.Ruckig(1), request)


def _from(at: _Values, limits: _Values) -> ruckig.InputParameter:
    request = ruckig.InputParameter(1)
    request.current_position, request.current_velocity, request.current_acceleration = ([x] for x in at)
    request.max_velocity, request.max_acceleration, request.max_jerk = ([x] for x in limits)
    return request


def _last(trajectory: Any) -> _Values:
    (place,), (velocity,), (acceleration,) = trajectory.at_time(trajectory.duration)
    return place, velocity, acceleration


def _phases(trajectory: Any) -> FloatArray:
    """(9, 5) of a trajectory's phases: how long each is, and place, velocity, acceleration and jerk there."""
    profile = trajectory.profiles[0][0]
    # Two come before ruckig's seven, where something is beyond its limit at first.
    first = profile.brake
    return np.array([[*getattr(first, name), *getattr(profile, name)[:7]] for name in "tpvaj"]).T


def _planned(planner: Any, request: Any) -> Any:
    trajectory = ruckig.Trajectory(planner.degrees_of_freedom)
    result = planner.calculate(request, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise AssertionError(f"no motion can be planned: {result}")
    return trajectory


class Motion:
    """Motion of one arm, at rest at first.

    Args:
        positions: (n,) where it is [rad] or [m].
    """

    def __init__(self, joints: Joints, positions: FloatArray) -> None:
        self._joints = joints
        self._planner = ruckig.Ruckig(len(joints))
        self._trajectory: _Trajectory | None = None
        self._begin_s = 0.0
        self._end = self._at_rest(positions)

    def state(self, now_s: float) -> ArmState:
        """Where the arm is at a time after the last plan's beginning."""
        if self._trajectory is None or now_s >= self.end_s:
            return self._end
        sample = self._trajectory.at_time(max(now_s - self._begin_s, 0.0))
        return ArmState(*(np.array(values, dtype=np.float64) for values in sample))

    @property
    def end_s(self) -> float:
        """When the arm will be at rest."""
        return self._begin_s + (self._trajectory.duration if self._trajectory is not None else 0.0)

    def moving(self, now_s: float) -> bool:
        """Whether the plan is still running."""
        return now_s < self.end_s

    def move(self, target: FloatArray, now_s: float, *, speed: float) -> None:
        """Go to a target and rest there, all joints arriving together.

        Args:
            target: (n,) [rad] or [m], within the limits.
            speed: Fraction of the joints' greatest speeds, above 0 to 1.
        """
        line = self._trajectory
        if not self.moving(now_s):
            self._follow(
                straight_motion(self._joints, self._end.positions, target, speed=speed), now_s, target
            )
            return
        if isinstance(line, StraightMotion) and np.array_equal(line.target, target):
            self._follow(line.at_speed(now_s - self._begin_s, speed), now_s, target)
            return
        request = self._request(now_s, speed)
        request.target_position = target.tolist()
        request.synchronization = ruckig.Synchronization.Phase
        self._follow(_planned(self._planner, request), now_s, target)

    def brake(self, now_s: float) -> None:
        """Come to rest as fast as accelerations and jerks allow; on the line, if it is on one."""
        line = self._trajectory
        if isinstance(line, StraightMotion) and self.moving(now_s):
            braked = line.braked(now_s - self._begin_s)
            self._follow(braked, now_s, braked.end)
            return
        request = self._request(now_s, 1.0)
        request.control_interface = ruckig.ControlInterface.Velocity
        trajectory = _planned(self._planner, request)
        end = trajectory.at_time(trajectory.duration)[0]
        self._follow(trajectory, now_s, np.array(end, dtype=np.float64))

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
        # A planner's sums end a few 1e-15 off: what was asked for is where it arrives.
        self._trajectory, self._begin_s = trajectory, now_s
        self._end = self._at_rest(end)

    def _at_rest(self, positions: FloatArray) -> ArmState:
        return ArmState(positions, np.zeros(len(self._joints)), np.zeros(len(self._joints)))
