"""Jerk-limited motion of all joints on a straight line in joint space, from rest to rest.

One profile moves all joints; the joint that reaches its limit first determines it. A check takes an arm's
position at each time from it, and the simulated controller drives it.
"""

from dataclasses import dataclass
from math import cbrt, sqrt
from typing import Any, TypeAlias

import numpy as np

from robots.kinematics.joints import FloatArray, Joints

# Homing is slow because the positions are not yet known. The rest is for the search of the joints' marks.
HOMING_SPEED = 0.5
HOMING_REST_S = 0.5

# A shorter way is rounding [rad] or [m].
_NO_WAY = 1e-12

# Limits on a line: velocity, acceleration, jerk.
Limits: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class StraightMotion:
    """Motion on a straight line in joint space, to its target or until it has braked.

    One profile moves all joints; the joint that reaches its limit first determines the speed. Ruckig's
    phase-synchronized motion is not used: it silently leaves the straight line if the slowest joint's profile
    exceeds another joint's limits, and the driven line must be the checked line.

    Attributes:
        start, target: (n,) the line's ends [rad] or [m].
        end: (n,) where the motion ends: at the target unless it brakes.
        duration: [s]
        times, shares: phases of constant jerk: their start times (phases,) [s], and (phases, 4) the share of
            the way at each start, with its rate, acceleration and jerk.
    """

    start: FloatArray
    target: FloatArray
    end: FloatArray
    duration: float
    times: FloatArray
    shares: FloatArray

    def progress(self, times_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the completed share of the way at times (m,), 0 to 1, and its rate [1/s]."""
        share, rate, _ = self.share_at(times_s)
        return np.clip(share, 0.0, 1.0), rate

    def at_time(self, time_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the (n,) positions, velocities and accelerations at a time since the start."""
        share, rate, curvature = self.share_at(np.float64(time_s))
        way = self.target - self.start
        return self.start + share * way, rate * way, curvature * way

    def share_at(self, times_s: Any) -> tuple[Any, Any, Any]:
        """Return the completed share of the way at times, its rate [1/s] and its acceleration [1/s²]."""
        phase = np.clip(np.searchsorted(self.times, times_s, side="right") - 1, 0, len(self.times) - 1)
        t = np.clip(times_s, 0.0, self.duration) - self.times[phase]
        s, v, a, j = self.shares[phase].T
        return s + t * (v + t * (a / 2 + t * j / 6)), v + t * (a + t * j / 2), a + t * j


def straight_motion(
    joints: Joints, start: FloatArray, target: FloatArray, *, speed: float
) -> StraightMotion | None:
    """Plan a straight motion from rest to rest; None if start and target are equal but for rounding.

    Args:
        start, target: (n,) [rad] or [m].
        speed: Fraction of the joints' maximum speeds, in (0, 1].
    """
    if np.abs(target - start).max() < _NO_WAY:
        return None
    length, limits = line_limits(joints, start, target, speed)
    phases = _rest_to_rest(length, limits)
    begins = np.concatenate([[0.0], np.cumsum(phases[:-1, 0])])
    return StraightMotion(start, target, target, float(phases[:, 0].sum()), begins, phases[:, 1:] / length)


def line_limits(joints: Joints, start: FloatArray, target: FloatArray, speed: float) -> tuple[float, Limits]:
    """Return the length of a line, and the limits of a motion on it.

    The unit is that of the joint that moves farthest, so that the values have a joint's magnitude.
    """
    way = np.abs(target - start)
    moving = way > 0
    length = float(way.max())
    fastest, quickest, sharpest = (
        float((limit[moving] * (length / way[moving])).min())
        for limit in (joints.max_speed * speed, joints.max_acceleration, joints.max_jerk)
    )
    return length, (fastest, quickest, sharpest)


def _rest_to_rest(length: float, limits: Limits) -> FloatArray:
    """Return the (7, 5) phases of the fastest motion: duration, position, velocity, acceleration and jerk."""
    fastest, quickest, sharpest = limits
    # Without a limit of speed the peak is half way; a short motion does not reach the limit of acceleration.
    peak = cbrt(length * length * sharpest / 4)
    if peak * sharpest > quickest**2:
        ramp = quickest / sharpest
        peak = quickest / 2 * (sqrt(ramp * ramp + 4 * length / quickest) - ramp)
    peak = min(peak, fastest)
    ramp = min(quickest / sharpest, sqrt(peak / sharpest))
    constant = max(peak / quickest - ramp, 0.0)
    cruise = max(length / peak - (2 * ramp + constant), 0.0)
    durations = (ramp, constant, ramp, cruise, ramp, constant, ramp)
    phases, place, velocity, acceleration = [], 0.0, 0.0, 0.0
    for t, sign in zip(durations, (1, 0, -1, 0, -1, 0, 1), strict=True):
        jerk = sign * sharpest
        phases.append((t, place, velocity, acceleration, jerk))
        place += t * (velocity + t * (acceleration / 2 + t * jerk / 6))
        velocity += t * (acceleration + t * jerk / 2)
        acceleration += t * jerk
    return np.array(phases)
