"""Motion of a script on a straight line in joint space, with trapezoidal speed; time is an argument."""

import math

import numpy as np

from robots.joints import FloatArray
from robots.motion import ArmState


class LineMotion:
    """Motion of all joints from rest to rest; the leading joint has the speed and acceleration.

    Args:
        start, target: (n,) [rad].
        speed: [rad/s], above 0.
        acceleration: [rad/s²], above 0.
        scale: Fraction of the speed that the speed slider permits, above 0.
    """

    def __init__(
        self,
        start: FloatArray,
        target: FloatArray,
        *,
        speed: float,
        acceleration: float,
        now_s: float,
        scale: float = 1.0,
    ) -> None:
        way = target - start
        self._start, self.target = start, target
        self._length = float(np.abs(way).max(initial=0.0))
        self._direction = way / self._length if self._length > 0.0 else way
        self._at_s, self._path_s, self._scale = now_s, 0.0, scale
        peak = min(speed, math.sqrt(acceleration * self._length))
        ramp_s = peak / acceleration
        cruise_s = max(0.0, self._length / peak - ramp_s) if peak > 0.0 else 0.0
        # Of each phase: duration, and its acceleration.
        self._phases = [(ramp_s, acceleration), (cruise_s, 0.0), (ramp_s, -acceleration)]
        self._begin = (0.0, 0.0)
        self.braking = False

    def scale(self, scale: float, now_s: float) -> None:
        """Change the fraction of the speed."""
        if not self.braking:
            self._path_s, self._at_s, self._scale = self._path_time(now_s), now_s, scale

    def brake(self, deceleration: float, now_s: float) -> None:
        """Come to rest on the line."""
        place, rate, _ = self._on_line(now_s)
        self._begin = (place, rate)
        self._phases = [(rate / deceleration, -deceleration)]
        self._at_s, self._path_s, self._scale = now_s, 0.0, 1.0
        self.braking = True

    def moving(self, now_s: float) -> bool:
        """Return whether it has not ended."""
        return self._path_time(now_s) < sum(duration for duration, _ in self._phases)

    def state(self, now_s: float) -> ArmState:
        """Return positions, velocities and accelerations."""
        place, rate, change = self._on_line(now_s)
        if not self.braking and not self.moving(now_s):
            zeros = np.zeros(len(self.target))
            return ArmState(self.target, zeros, zeros)
        return ArmState(
            self._start + place * self._direction, rate * self._direction, change * self._direction
        )

    def _path_time(self, now_s: float) -> float:
        return self._path_s + (now_s - self._at_s) * self._scale

    def _on_line(self, now_s: float) -> tuple[float, float, float]:
        """Return place [rad], rate [rad/s] and its change [rad/s²] of the leading joint."""
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
    """Return speed [rad/s] and acceleration [rad/s²] of a motion that takes a time [s]."""
    rest = (acceleration * time_s) ** 2 - 4.0 * acceleration * length
    if rest < 0.0:
        return 2.0 * length / time_s, 4.0 * length / time_s**2
    return (acceleration * time_s - math.sqrt(rest)) / 2.0, acceleration
