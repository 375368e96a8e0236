"""Judgement of a joint's limits: a value that no arm has is doubtful, and never means "no limit"."""

from math import pi

from robots.kinematics.kinematic_tree import Doubt
from robots.schema.robot_toml import JointType

_ROTARY, _PRISMATIC = JointType.ROTARY, JointType.PRISMATIC
_UNIT = {_ROTARY: "rad", _PRISMATIC: "m"}
_OTHER_UNIT = {_ROTARY: ("degrees", pi / 180), _PRISMATIC: ("millimetres", 1e-3)}
# Wrists turn up to twice to each side, tracks are shorter, and files of real hands state 100 rad/s.
_FARTHEST = {_ROTARY: 4.01 * pi, _PRISMATIC: 20.0}
_FASTEST = {_ROTARY: 100.0, _PRISMATIC: 20.0}
# Assumed where a file states nothing credible [rad], [m] and per second. Sliders, planners and controllers
# need limits: from both sides of a turn every direction can be reached, and a cable is not wound up.
REACH = {_ROTARY: 2 * pi, _PRISMATIC: 1.0}
SPEED = {_ROTARY: pi / 2, _PRISMATIC: 0.25}


def probable_range(
    kind: JointType, lower: float | None, upper: float | None
) -> tuple[float, float, Doubt | None]:
    """Return the limits that a file probably means, and the doubt about those that it states.

    Args:
        lower, upper: As stated [rad] or [m], lower <= upper; None: not stated.
    """
    unit, (other, factor), reach = _UNIT[kind], _OTHER_UNIT[kind], REACH[kind]
    low, high = lower or 0.0, upper or 0.0
    stated = {key: each for key, each in (("lower", lower), ("upper", upper)) if each is not None}
    farthest = max(abs(low), abs(high))
    if farthest > _FARTHEST[kind]:
        key = "lower" if farthest == abs(low) else "upper"
        text = f"{key} = {_amount(stated[key], kind, '')}; "
        if farthest * factor <= _FARTHEST[kind]:
            low, high = low * factor, high * factor
            text += f"probably {other}: {low:.5g} to {high:.5g} {unit}"
            return low, high, Doubt(text, stated)
        low, high = max(low, -reach), min(high, reach)
    elif low == high == 0.0:
        text = "lower and upper are zero or not stated; "
    elif lower is None or upper is None:
        text = f"{'lower' if lower is None else 'upper'} is not stated; zero is assumed"
        return low, high, Doubt(text, stated, assumed=True)
    else:
        return low, high, None
    low, high = (low, high) if low < high else (-reach, reach)
    text += f"{low:.5g} to {high:.5g} {unit} is assumed"
    return low, high, Doubt(text, stated, assumed=True)


def probable_speed(kind: JointType, speed: float, limits: Doubt | None) -> tuple[float, Doubt | None]:
    """Return the speed limit that a file probably means, and the doubt about the one that it states.

    Args:
        speed: As stated [rad/s] or [m/s]; zero: not stated.
        limits: The doubt about the joint's limits: with limits in degrees, a slower speed is in degrees, too.
    """
    unit, (other, factor) = _UNIT[kind], _OTHER_UNIT[kind]
    fastest = _FASTEST[kind] if limits is None or limits.assumed else REACH[kind]
    if 0 < speed <= fastest:
        return speed, None
    text = f"velocity = {_amount(speed, kind, '/s')}" if speed > 0 else "has no velocity limit"
    assumed = not fastest < speed <= _FASTEST[kind] / factor
    probable = SPEED[kind] if assumed else speed * factor
    text += (
        f"; {probable:.4g} {unit}/s is assumed"
        if assumed
        else f"; probably {other}/s: {probable:.5g} {unit}/s"
    )
    return probable, Doubt(text, {"velocity": speed}, assumed)


def _amount(value: float, kind: JointType, per: str) -> str:
    turns = int(abs(value) / (2 * pi))
    # Of an absurd number the turns say nothing more.
    shown = f" is {turns:,} turns{per}" if kind is _ROTARY and turns < 1e6 else ""
    return f"{value:.6g} {_UNIT[kind]}{per}{shown}"
