"""Judgement of joint positions: can an arm of this description have reached them? No I/O.

The controllers' protocols have no checksum, so a corrupted answer is often a well-formed one. Joints cannot
be right if one of them

- is not a finite number, or has a velocity that is not one
- is beyond a limit by more than 20 degrees or 0.1 m: a real arm may be a little outside its soft limits
- is farther from its position in the unit before than twice `max_speed` allows in the time between and a
  tenth of a second: drives may be faster than a description says. The unit before may have been delayed, so
  the time counts from the receipt of its predecessor.

After a leap the next unit is compared with the position it led to: an arm that is elsewhere for good is
shown there. Positions of an arm that is not homed, or is homing, may start again from zero: no step counts,
and a limit only if it is exceeded by more than a turn or 1 m.
"""

from collections.abc import Mapping, Sequence
from math import inf, isfinite, pi, radians, remainder
from sys import float_info

from protocol_gateway.seam import Activity, StatusReceived
from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.kinematics.joints import Joints, JointType, position_text

_MARGINS = {JointType.ROTARY: radians(20.0), JointType.PRISMATIC: 0.1}
_UNHOMED_MARGINS = {JointType.ROTARY: 2 * pi, JointType.PRISMATIC: 1.0}
_SPEED_FACTOR, _SLACK_S = 2.0, 0.1


class Plausibility:
    """Judge of the joint positions of one robot, from its description and the unit before."""

    def __init__(self, joints: Joints) -> None:
        self._joints = joints
        self._fastest = tuple((_SPEED_FACTOR * joints.max_speed).tolist())
        self._homed, self._unhomed = _bounds(joints, _MARGINS), _bounds(joints, _UNHOMED_MARGINS)
        self._restarts = False
        self.connected()

    def connected(self) -> None:
        """Forget the unit before: another controller may answer now."""
        self._before: tuple[float, ...] | None = None
        # Receipt of the unit before, and of the one before that: it was measured after this time.
        self._received_s = self._measured_after_s = -inf

    def follow(self, status: StatusReceived) -> None:
        """Take the newest status."""
        restarts = status.homed is False or status.activity is Activity.HOMING
        if restarts or self._restarts:
            self._before = None
        self._restarts = restarts

    def problem(
        self, positions: tuple[float, ...], velocities: tuple[float, ...] | None, now_s: float
    ) -> Reason | None:
        """Take the next positions; return why they cannot be the arm's; None: they can.

        Args:
            positions: One a joint [rad] or [m].
            velocities: One a joint [rad/s] or [m/s]; None: not reported.
            now_s: Time of the receipt, on the gateway's monotonic clock.
        """
        if velocities is not None and not all(map(isfinite, velocities)):
            return self._no_number(velocities)
        lowest, highest = self._unhomed if self._restarts else self._homed
        before = positions if self._before is None or self._restarts else self._before
        elapsed_s = now_s - self._measured_after_s + _SLACK_S
        for position, earlier, least, most, fastest in zip(
            positions, before, lowest, highest, self._fastest, strict=True
        ):
            # Nothing compares with a value that is no number.
            if not (least <= position <= most and abs(position - earlier) <= fastest * elapsed_s):
                return self._explained(positions, before, now_s)
        self._take(positions, now_s)
        return None

    def _take(self, positions: tuple[float, ...], now_s: float) -> None:
        self._measured_after_s = now_s if self._before is None else self._received_s
        self._before, self._received_s = positions, now_s

    def _no_number(self, values: Sequence[float]) -> Reason:
        rows = zip(self._joints.names, values, strict=True)
        return codes.JOINT_NO_NUMBER(name=next(name for name, value in rows if not isfinite(value)))

    def _explained(
        self, positions: tuple[float, ...], before: tuple[float, ...], now_s: float
    ) -> Reason | None:
        """Return the problem; None: a joint without limits counts from another turn."""
        joints = self._joints
        if not all(map(isfinite, positions)):
            return self._no_number(positions)
        lowest, highest = self._unhomed if self._restarts else self._homed
        for number, (name, kind, position) in enumerate(
            zip(joints.names, joints.types, positions, strict=True)
        ):
            if not lowest[number] <= position <= highest[number]:
                return codes.JOINT_FAR(
                    name=name,
                    value=position_text(position, kind),
                    lower=position_text(float(joints.lower[number]), kind),
                    upper=position_text(float(joints.upper[number]), kind),
                )
        elapsed_s, seconds = now_s - self._measured_after_s, now_s - self._received_s
        self._take(positions, now_s)
        for name, kind, endless, position, earlier, fastest in zip(
            joints.names, joints.types, joints.continuous, positions, before, self._fastest, strict=True
        ):
            step = remainder(position - earlier, 2 * pi) if endless else position - earlier
            if abs(step) > fastest * (elapsed_s + _SLACK_S):
                return codes.JOINT_LEAP(
                    name=name,
                    before=position_text(earlier, kind),
                    after=position_text(position, kind),
                    seconds=seconds,
                )
        return None


def _bounds(joints: Joints, margins: Mapping[JointType, float]) -> tuple[tuple[float, ...], ...]:
    """Return the lowest and the highest positions [rad] or [m]: finite numbers, also without limits."""
    rows = [
        (-float_info.max, float_info.max)
        if endless
        else (float(lower) - margins[kind], float(upper) + margins[kind])
        for lower, upper, kind, endless in zip(
            joints.lower, joints.upper, joints.types, joints.continuous, strict=True
        )
    ]
    return tuple(least for least, _ in rows), tuple(most for _, most in rows)
