"""Jerk-limited motion of all joints, as a function of time.

A motion is planned once and then only sampled, so that a late tick makes no error. A new plan
begins where the old one is at that moment, in position, speed and acceleration: no command makes
the arm jump. Time is an argument: seconds on any clock that does not go back.
"""

from dataclasses import dataclass

import numpy as np
import ruckig

from robots.joints import FloatArray, Joints


@dataclass(frozen=True, eq=False)
class ArmState:
    """Where the joints are, and how they move; each (n,) in rad or m, and seconds."""

    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray


class Motion:
    """Motion of one arm, at rest at first.

    Args:
        positions: (n,) where it is [rad] or [m].
    """

    def __init__(self, joints: Joints, positions: FloatArray) -> None:
        self._joints = joints
        self._planner = ruckig.Ruckig(len(joints))
        self._trajectory: ruckig.Trajectory | None = None
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
        request = self._request(now_s, speed)
        request.target_position = target.tolist()
        # In phase the path is a straight line between the joint positions: it keeps coupled limits, too.
        request.synchronization = ruckig.Synchronization.Phase
        self._plan(request, now_s, target)

    def brake(self, now_s: float) -> None:
        """Come to rest as fast as the greatest accelerations and jerks allow."""
        request = self._request(now_s, 1.0)
        request.control_interface = ruckig.ControlInterface.Velocity
        self._plan(request, now_s, None)

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

    def _plan(self, request: ruckig.InputParameter, now_s: float, target: FloatArray | None) -> None:
        trajectory = ruckig.Trajectory(len(self._joints))
        result = self._planner.calculate(request, trajectory)
        if result not in (ruckig.Result.Working, ruckig.Result.Finished):
            raise AssertionError(f"no motion can be planned: {result}")
        # The planner's sums end a few 1e-15 off: what was asked for is where it arrives.
        end = trajectory.at_time(trajectory.duration)[0] if target is None else target
        self._trajectory, self._begin_s = trajectory, now_s
        self._end = self._at_rest(np.array(end, dtype=np.float64))

    def _at_rest(self, positions: FloatArray) -> ArmState:
        return ArmState(positions, np.zeros(len(self._joints)), np.zeros(len(self._joints)))
