"""Alarm conditions of an arm's state: near a limit, a singular position, an obstacle or its own links.

Each has an activation threshold and a wider one that ends its deadband.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from robomesh.schemas.robomesh_pb2 import Event
from robots.collision import Nearest
from robots.kinematics.joints import FloatArray, Joints, JointType, constraint_values
from services.kinematics.alarms import Condition

# Fractions of a joint's range.
_LIMIT, _LIMIT_OVER = 0.02, 0.03
_SINGULAR, _SINGULAR_OVER = 0.02, 0.03
# Longer than a work cycle: an arm that passes a singular position in each cycle causes one event, not one a
# cycle. The demo of a Pt600 is away for 20 s of its 37 s; at a tenth of its speed for two minutes.
_SINGULAR_OVER_S = 300.0
# Deadband of a distance: a factor or an addition, the larger of the two.
_FURTHER, _FURTHER_M = 1.10, 5e-3
_APART_M = 1e-3
# The robots of a starting site do not report at the same time.
_MISSING_AFTER_S = 2.0

_S = Event.Severity


def limit_conditions(joints: Joints, positions: FloatArray) -> Iterator[Condition]:
    """Yield the joints, and sums of joints, that are near an end of their range.

    Args:
        positions: (n,) [rad] or [m].
    """
    ranges = [*zip(joints.names, joints.types, joints.lower.tolist(), joints.upper.tolist(), strict=True)]
    ranges += [(" + ".join(each.names), each.type, each.lower, each.upper) for each in joints.constraints]
    values = [*positions.tolist(), *constraint_values(joints, positions).tolist()]
    for (name, kind, lower, upper), value in zip(ranges, values, strict=True):
        end, limit = ("lower", lower) if value - lower < upper - value else ("upper", upper)
        left = value - lower if end == "lower" else upper - value
        if not (share := left / max(upper - lower, 1e-9)) <= _LIMIT_OVER:
            continue
        yield Condition(
            key=f"limit {name}",
            active=share < _LIMIT,
            code="kinematics.limit",
            severity=_S.WARNING,
            text=f"{name} is near the end of its range: {_text(value, kind)} of {_text(limit, kind)}",
            over=f"{name} is away from the end of its range again",
            values=(("joint", name), ("limit", end), ("left", f"{abs(limit - value):.6g}")),
        )


def singularity_conditions(margin: float) -> Iterator[Condition]:
    """Yield a condition if the arm is near a singular position."""
    if margin <= _SINGULAR_OVER:
        yield Condition(
            key="singularity",
            active=margin < _SINGULAR,
            code="kinematics.singularity",
            # INFO, not an alarm: joint moves pass there without harm, and the check refuses lines there.
            severity=_S.INFO,
            text=f"near a singular position, margin {margin:.3f}: a straight line would need fast joints",
            over="away from singular positions again",
            values=(("margin", f"{margin:.6g}"),),
            over_after_s=_SINGULAR_OVER_S,
        )


def own_conditions(nearest: Nearest | None) -> Iterator[Condition]:
    """Yield a condition if two links of the arm touch."""
    if nearest is not None and nearest.distance_m <= _APART_M:
        yield _touching("own links", nearest, over="no links of the arm touch any more")


def outside_conditions(
    close: Sequence[Nearest], distances: Callable[[tuple[str, str]], tuple[float, float]]
) -> Iterator[Condition]:
    """Yield a condition for each obstacle within its warning distance, within its stop distance, or touching.

    Args:
        close: Pairs of the arm (first) and a fixture or other robot, nearest pair first.
        distances: Function from a pair's names to its warning and stop distances [m].
    """
    seen = set()
    for each in close:
        one, other = each.pair
        obstacle = other.partition("/")[0]
        if obstacle in seen:
            continue  # a nearer pair with this obstacle came first
        seen.add(obstacle)
        for name, bound, severity in zip(
            ("warning", "stop"), distances(each.pair), (_S.WARNING, _S.ERROR), strict=True
        ):
            if each.distance_m > deadband_end(bound):
                continue
            yield Condition(
                key=f"{name} {obstacle}",
                active=each.distance_m < bound,
                code=f"kinematics.clearance.{name}",
                severity=severity,
                text=(
                    f"{one} is {each.distance_m * 1000:.0f} mm from {other}, "
                    f"within the {name} distance of {bound * 1000:g} mm"
                ),
                over=f"{obstacle} is out of the {name} distance of {bound * 1000:g} mm again",
                values=_values(each),
            )
        if each.distance_m <= _FURTHER_M:
            yield _touching(obstacle, each, over=f"the arm does not touch {obstacle} any more")


def deadband_end(distance_m: float) -> float:
    """Return the distance that ends the deadband of a threshold [m]."""
    return max(_FURTHER * distance_m, distance_m + _FURTHER_M)


def missing_conditions(not_counted: Sequence[str]) -> Iterator[Condition]:
    """Yield a condition for each robot of the cell at an unknown position."""
    for robot in not_counted:
        yield Condition(
            key=f"missing {robot}",
            active=True,
            code="kinematics.not_counted",
            severity=_S.WARNING,
            text=f"clearance does not count {robot}: its position is unknown",
            over=f"clearance counts {robot} again",
            values=(("robot", robot),),
            after_s=_MISSING_AFTER_S,
        )


def _touching(name: str, nearest: Nearest, *, over: str) -> Condition:
    return Condition(
        key=f"touching {name}",
        active=nearest.distance_m <= 0.0,
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
