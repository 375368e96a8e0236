"""Reasons for a pose without a solution: out of reach, limits, orientation."""

from collections.abc import Sequence
from itertools import islice
from math import degrees, dist
from typing import Any

import numpy as np

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.kinematics.inverse.chain import Chain, placement_misses
from robots.kinematics.inverse.numeric import DescentEnd, descend, starts
from robots.kinematics.inverse.tasks import TOLERANCE_M, Task
from robots.kinematics.joints import FloatArray, violations
from robots.schema.robot_toml import JointType

_TRIES = 30
# Tolerated position error in the search for the best orientation at the position.
_AT_PLACE_M = 1e-4


def reason_for_none(
    chain: Chain,
    target: Any,
    task: Task,
    beyond: Sequence[FloatArray],
    nearest: DescentEnd,
    around: FloatArray,
    seed: int,
) -> tuple[Reason, DescentEnd]:
    """Return why no joint positions put the tool at a target, in degrees and millimetres.

    Args:
        target: A pin.SE3, tool to base.
        beyond: The result of `solutions_beyond`.
        nearest: The nearest result within limits.
        around: (n,) positions of the joints that do not move the tool.

    Returns:
        The reason, and the nearest result with respect to it.
    """
    if beyond:
        return codes.INVERSE_LIMITS(*_violated_limits(chain, beyond, around)), nearest
    if beyond_reach(chain, target):
        away, reach = _mm(_distance(chain, target)), _mm(chain.reach)
        return codes.INVERSE_TOO_FAR(distance=away, reach=reach), nearest
    begins = [nearest.x, *islice(starts(chain, seed), _TRIES)]
    there = [descend(chain, target, Task.POSITION_3D.rows, begin) for begin in begins]
    closest = min(there, key=lambda each: each.residual_m)
    if not closest.near_enough:
        return codes.INVERSE_GAP(distance=_mm(closest.residual_m)), nearest
    posed = [
        DescentEnd(each.x, *placement_misses(chain, each.x, target, task.rows))
        for each in there
        if each.near_enough
    ]
    turned = [descend(chain, target, task.rows, each.x, place_first=True) for each in posed]
    at_place = [each for each in (*posed, *turned) if each.residual_m < _AT_PLACE_M]
    nearest = min(at_place, key=lambda each: each.residual_rad)
    code = codes.INVERSE_ORIENTATION if task is Task.POSE_6D else codes.INVERSE_AXIS
    return code(angle=f"{degrees(nearest.residual_rad):.2f}°"), nearest


def solutions_beyond(
    chain: Chain, target: Any, task: Task, known: Sequence[Sequence[float]], nearest: DescentEnd, seed: int
) -> list[FloatArray]:
    """Return solutions (m,) that ignore limits, with each rotary joint at the turn nearest to its limits.

    Args:
        target: A pin.SE3, tool to base.
        known: Solutions in closed form; without any, solutions are searched for.
        nearest: The nearest result within limits.
    """
    placed = [np.array(x) for x in known]
    found = [DescentEnd(x, *placement_misses(chain, x, target, task.rows)) for x in placed]
    if not any(each.near_enough for each in found) and not beyond_reach(chain, target):
        begins = [nearest.x, *islice(starts(chain, seed), _TRIES)]
        found = [descend(chain, target, task.rows, begin, limited=False) for begin in begins]
    return [_nearest_turns(chain, each.x) for each in found if each.near_enough]


def beyond_reach(chain: Chain, target: Any) -> bool:
    """Return whether a target, a pin.SE3, is further away than the stretched arm reaches."""
    return _distance(chain, target) > chain.reach + TOLERANCE_M


def _distance(chain: Chain, target: Any) -> float:
    # Without a joint that moves the tool, measure from the tool.
    first = chain.origins[0] if len(chain.origins) else chain.tool_to_base[:3, 3]
    # For three numbers, this takes a third of the time of NumPy's norm.
    return dist(target.translation.tolist(), first.tolist())


def _nearest_turns(chain: Chain, x: FloatArray) -> FloatArray:
    """Shift rotary positions by whole turns to the nearest to the middle of their limits."""
    middle = (chain.lower + chain.upper) / 2
    types = [chain.joints.types[number] for number in chain.moving]
    turns = np.round((x - middle) / (2 * np.pi)) * [kind is JointType.ROTARY for kind in types]
    turned: FloatArray = x - 2 * np.pi * turns
    return turned


def _violated_limits(chain: Chain, solutions: Sequence[FloatArray], around: FloatArray) -> Sequence[Reason]:
    """Return the limits that the solution closest to them violates."""

    def excess(x: FloatArray) -> float:
        return float(np.maximum(np.maximum(chain.lower - x, x - chain.upper), 0.0).sum())

    x = min(solutions, key=excess)
    joints = chain.joints
    violated = []
    for number, position in zip(chain.moving.tolist(), x.tolist(), strict=True):
        lower, upper = float(joints.lower[number]), float(joints.upper[number])
        if not lower <= position <= upper:
            of = joints.types[number]
            violated.append(
                codes.JOINT_BEYOND(
                    name=joints.names[number],
                    value=_position(position, of),
                    lower=_position(lower, of),
                    upper=_position(upper, of),
                )
            )
    if violated:
        return violated
    positions = around.copy()
    positions[chain.moving] = x
    return violations(joints, positions)


def _position(position: float, of: JointType) -> str:
    return f"{degrees(position):.2f}°" if of is JointType.ROTARY else _mm(position)


def _mm(metres: float) -> str:
    return f"{metres * 1000:.2f} mm"
