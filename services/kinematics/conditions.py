"""What of an arm's state is worth an event: near a limit, a singular position, a thing, itself.

Each is met at one threshold and near until another, further one.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from robomesh.schemas.robomesh_pb2 import Event
from robots.collision import Nearest
from robots.joints import FloatArray, Joints, JointType, constraint_values
from services.kinematics.alarms import Condition

# Shares of a joint's range.
_LIMIT, _LIMIT_OVER = 0.02, 0.03
_SINGULAR, _SINGULAR_OVER = 0.02, 0.03
# An arm whose work passes a singular position again and again is one event, not one a cycle. The demo
# of a Pt600 stays away for 20 s of its 37 s; at a tenth of its speed for two minutes.
_SINGULAR_OVER_S = 300.0
# The larger of the two further away is far enough.
_FURTHER, _FURTHER_M = 1.10, 5e-3
_APART_M = 1e-3
# When a site starts, its robots come one after the other.
_MISSING_AFTER_S = 2.0

_S = Event.Severity


def limit_conditions(joints: Joints, positions: FloatArray) -> Iterator[Condition]:
    """Joints, and sums of joints, near an end of their range.

    Args:
        positions: (n,) [rad] or [m].
    """
    names = [*joints.names, *(" + ".join(constraint.names) for constraint in joints.constraints)]
    types = [*joints.types, *(constraint.type for constraint in joints.constraints)]
    values = np.concatenate([positions, constraint_values(joints, positions)])
    lower = np.concatenate([joints.lower, [constraint.lower for constraint in joints.constraints]])
    upper = np.concatenate([joints.upper, [constraint.upper for constraint in joints.constraints]])
    shares = np.minimum(values - lower, upper - values) / np.maximum(upper - lower, 1e-9)
    for number in np.flatnonzero(shares <= _LIMIT_OVER).tolist():
        name, kind, value = names[number], types[number], float(values[number])
        low = value - lower[number] < upper[number] - value
        end, limit = ("lower", lower[number]) if low else ("upper", upper[number])
        yield Condition(
            key=f"limit {name}",
            met=bool(shares[number] < _LIMIT),
            code="kinematics.limit",
            severity=_S.WARNING,
            text=f"{name} is near the end of its range: {_text(value, kind)} of {_text(float(limit), kind)}",
            over=f"{name} is away from the end of its range again",
            values=(("joint", name), ("limit", end), ("left", f"{abs(limit - value):.6g}")),
        )


def singularity_conditions(margin: float) -> Iterator[Condition]:
    """A singular position that is near."""
    if margin <= _SINGULAR_OVER:
        yield Condition(
            key="singularity",
            met=margin < _SINGULAR,
            code="kinematics.singularity",
            # No alarm: joint moves pass there as anywhere, and for a line the check refuses it beforehand.
            severity=_S.INFO,
            text=f"near a singular position, margin {margin:.3f}: a straight line would ask for fast joints",
            over="away from singular positions again",
            values=(("margin", f"{margin:.6g}"),),
            over_after_s=_SINGULAR_OVER_S,
        )


def own_conditions(nearest: Nearest | None) -> Iterator[Condition]:
    """Two links of the arm that touch."""
    if nearest is not None and nearest.distance_m <= _APART_M:
        yield _touching("own links", nearest, over="no links of the arm touch any more")


def outside_conditions(
    close: Sequence[Nearest], distances: Callable[[tuple[str, str]], tuple[float, float]]
) -> Iterator[Condition]:
    """Fixtures and other robots that are near: to be warned of, to stop at, touched.

    Args:
        close: Nearest first, the arm's own end first.
        distances: To be warned of and to stop at, of a pair [m].
    """
    seen = set()
    for each in close:
        one, other = each.pair
        thing = other.partition("/")[0]
        if thing in seen:
            continue  # further away than the pair that was told of
        seen.add(thing)
        for name, bound, severity in zip(
            ("warning", "stop"), distances(each.pair), (_S.WARNING, _S.ERROR), strict=True
        ):
            if each.distance_m > far_from(bound):
                continue
            yield Condition(
                key=f"{name} {thing}",
                met=each.distance_m < bound,
                code=f"kinematics.clearance.{name}",
                severity=severity,
                text=(
                    f"{one} is {each.distance_m * 1000:.0f} mm from {other}, "
                    f"within the {name} distance of {bound * 1000:g} mm"
                ),
                over=f"{thing} is out of the {name} distance of {bound * 1000:g} mm again",
                values=_values(each),
            )
        if each.distance_m <= _FURTHER_M:
            yield _touching(thing, each, over=f"nothing touches {thing} any more")


def far_from(distance_m: float) -> float:
    """Further away than this, a thing is not near a distance any more [m]."""
    return max(_FURTHER * distance_m, distance_m + _FURTHER_M)


def missing_conditions(not_counted: Sequence[str]) -> Iterator[Condition]:
    """Robots of the cell of which nobody knows where they are now."""
    for robot in not_counted:
        yield Condition(
            key=f"missing {robot}",
            met=True,
            code="kinematics.not_counted",
            severity=_S.WARNING,
            text=f"clearance leaves {robot} out: nobody knows where it is now",
            over=f"clearance counts {robot} again",
            values=(("robot", robot),),
            after_s=_MISSING_AFTER_S,
        )


def _touching(what: str, nearest: Nearest, *, over: str) -> Condition:
    return Condition(
        key=f"touching {what}",
        met=nearest.distance_m <= 0.0,
        code="kinematics.collision",
        severity=_S.ERROR,
        text=f"{nearest.pair[0]} and {nearest.pair[1]} touch",
        over=over,
        values=_values(nearest),
    )


def _values(nearest: Nearest) -> tuple[tuple[str, str], ...]:
    return (
        ("first", nearest.pair[0]),
        ("second", nearest.pair[1]),
        ("distance_m", f"{nearest.distance_m:.6g}"),
    )


def _text(value: float, kind: JointType) -> str:
    return f"{np.degrees(value):.1f}°" if kind is JointType.ROTARY else f"{value * 1000:.1f} mm"
