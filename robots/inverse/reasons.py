"""Why there is no solution: out of reach, limits, not this orientation."""

from collections.abc import Sequence
from itertools import islice
from math import degrees
from typing import Any

import numpy as np

from robots.inverse.chain import Chain, placement_misses
from robots.inverse.numeric import Found, descend, starts
from robots.inverse.tasks import TOLERANCE_M, Task
from robots.joints import FloatArray, violations
from robots.schema import JointType

_TRIES = 30
# An orientation is sought along with its place, which then is missed by this at most.
_AT_PLACE_M = 1e-4


def reason_for_none(
    chain: Chain,
    target: Any,
    task: Task,
    beyond: Sequence[FloatArray],
    nearest: Found,
    around: FloatArray,
    seed: int,
) -> tuple[str, Found]:
    """Why no joint positions put the tool at a target, for people: in degrees and millimetres.

    Args:
        target: A pin.SE3, tool to base.
        beyond: What `solutions_beyond` found.
        nearest: What came nearest, within limits.
        around: (n,) where the joints are that do not move the tool.

    Returns:
        The reason, and what comes nearest in that light.
    """
    if beyond:
        return f"limits: found only with {_forbidden(chain, beyond, around)}", nearest
    if beyond_reach(chain, target):
        away, reach = _mm(_distance(chain, target)), _mm(chain.reach)
        said = f"{away} from the first joint, and the tool gets no further away than {reach}"
        return f"out of reach: {said}", nearest
    begins = [nearest.x, *islice(starts(chain, seed), _TRIES)]
    there = [descend(chain, target, Task.POSITION_3D.rows, begin) for begin in begins]
    closest = min(there, key=lambda each: each.residual_m)
    if not closest.near_enough:
        said = f"within its limits the tool comes no nearer to this place than {_mm(closest.residual_m)}"
        return f"out of reach: {said}", nearest
    posed = [
        Found(each.x, *placement_misses(chain, each.x, target, task.rows))
        for each in there
        if each.near_enough
    ]
    turned = [descend(chain, target, task.rows, each.x, place_first=True) for each in posed]
    at_place = [each for each in (*posed, *turned) if each.residual_m < _AT_PLACE_M]
    nearest = min(at_place, key=lambda each: each.residual_rad)
    what = "orientation" if task is Task.POSE_6D else "axis"
    said = f"the tool can be there, but its {what} would be {degrees(nearest.residual_rad):.2f}° off at best"
    return f"not this orientation: {said}", nearest


def solutions_beyond(
    chain: Chain, target: Any, task: Task, known: Sequence[Sequence[float]], nearest: Found, seed: int
) -> list[FloatArray]:
    """Solutions (m,) where there were no limits, each rotary joint by the turn that is nearest to its own.

    Args:
        target: A pin.SE3, tool to base.
        known: Those in closed form; where there are none, they are searched for.
        nearest: What came nearest, within limits.
    """
    placed = [np.array(x) for x in known]
    found = [Found(x, *placement_misses(chain, x, target, task.rows)) for x in placed]
    if not any(each.near_enough for each in found) and not beyond_reach(chain, target):
        begins = [nearest.x, *islice(starts(chain, seed), _TRIES)]
        found = [descend(chain, target, task.rows, begin, limited=False) for begin in begins]
    return [_turned(chain, each.x) for each in found if each.near_enough]


def beyond_reach(chain: Chain, target: Any) -> bool:
    """Whether a target, a pin.SE3, is further away than all links in a row."""
    return _distance(chain, target) > chain.reach + TOLERANCE_M


def _distance(chain: Chain, target: Any) -> float:
    # A tool that no joint moves has a first joint where it is itself.
    first = chain.origins[0] if len(chain.origins) else chain.tool_to_base[:3, 3]
    return float(np.linalg.norm(target.translation - first))


def _turned(chain: Chain, x: FloatArray) -> FloatArray:
    """Rotary positions by the turn that is nearest to the middle of their limits."""
    middle = (chain.lower + chain.upper) / 2
    types = [chain.joints.types[number] for number in chain.moving]
    turns = np.round((x - middle) / (2 * np.pi)) * [kind is JointType.ROTARY for kind in types]
    turned: FloatArray = x - 2 * np.pi * turns
    return turned


def _forbidden(chain: Chain, solutions: Sequence[FloatArray], around: FloatArray) -> str:
    """What forbids the solution that is least forbidden."""

    def excess(x: FloatArray) -> float:
        return float(np.maximum(np.maximum(chain.lower - x, x - chain.upper), 0.0).sum())

    x = min(solutions, key=excess)
    joints = chain.joints
    said = []
    for number, position in zip(chain.moving.tolist(), x.tolist(), strict=True):
        lower, upper = float(joints.lower[number]), float(joints.upper[number])
        if not lower <= position <= upper:
            of = joints.types[number]
            limits = f"{_position(lower, of)} to {_position(upper, of)}"
            said.append(
                f"joint {joints.names[number]} at {_position(position, of)}, which can be at {limits}"
            )
    if not said:
        positions = around.copy()
        positions[chain.moving] = x
        said = [str(each) for each in violations(joints, positions)]
    return " and ".join(said)


def _position(position: float, of: JointType) -> str:
    return f"{degrees(position):.2f}°" if of is JointType.ROTARY else _mm(position)


def _mm(metres: float) -> str:
    return f"{metres * 1000:.2f} mm"
