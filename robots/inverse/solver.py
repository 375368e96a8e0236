"""Joint positions for a tool's pose: in closed form where there is one, otherwise by search."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain as joined
from itertools import islice
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from robots.errors import PoseError
from robots.inverse.chain import Chain, build_chain, placement_misses
from robots.inverse.closed_form import EXACT, ClosedForm, candidates, closed_form, turned, windows
from robots.inverse.numeric import Found, clipped, descend, starts
from robots.inverse.reasons import beyond_reach, reason_for_none, solutions_beyond
from robots.inverse.tasks import Task, tool_pose
from robots.joints import FloatArray, as_positions
from robots.schema import RobotDescription

# Descents until a search gives up, and of one for all solutions.
_TRIES = 300
_SAMPLE = 100
# Descents where a solution is unlikely, or where one is known that might be better.
_FEW_TRIES = 20
# So many solutions are found for the nearest to be chosen, unless the walk from `near` itself ends at one.
_FEW = 3
# Nearer than this, two solutions are one [rad] or [m].
_SAME = 1e-6
# Whoever moves further between two places of a line is on another branch [rad] or [m].
_BRANCH = 0.5


@dataclass(frozen=True, eq=False)
class InverseSolver:
    """What solving needs to know of a robot. One thread at a time: its workspace is reused.

    Attributes:
        chain: The joints that move the tool.
        closed: None where there is no closed form.
    """

    chain: Chain
    closed: ClosedForm | None


@dataclass(frozen=True, eq=False)
class InverseResult:
    """What came of solving.

    Attributes:
        solutions: (k, n) joint positions [rad] or [m], the nearest first; none is a guess.
        residual_m: How far the tool is from its target, of the worst solution; where there is none,
            at the nearest place that was found.
        residual_rad: The same, of its orientation, or of its axis.
        reason: Why there is none; empty where there is one.
        analytic: In closed form: every branch is known, each by the turns that are nearest.
    """

    solutions: FloatArray
    residual_m: float
    residual_rad: float
    reason: str
    analytic: bool


def build_solver(description: RobotDescription) -> InverseSolver:
    """A solver for a description's tool."""
    chain = build_chain(description)
    return InverseSolver(chain, closed_form(chain))


def solve(
    solver: InverseSolver,
    tool_to_base: ArrayLike,
    *,
    task: Task,
    near: ArrayLike | None = None,
    all_solutions: bool = False,
    seed: int = 0,
) -> InverseResult:
    """Joint positions within limits that put the tool there: the nearest to `near`, or all.

    The same for the same arguments, always. Where a search has to find them, "the nearest" and "all"
    are of those that it found.

    Args:
        tool_to_base: (4, 4) or 16 numbers by rows [m].
        near: (n,) joint positions [rad] or [m]; none: home. Joints that do not move the tool stay there.
        seed: Of the search's starts.

    Raises:
        PoseError: If the pose is none, or `near` holds a number that is not finite.
        JointCountError: If `near` does not have one value per joint.
    """
    chain, closed = solver.chain, solver.closed
    pose = tool_pose(tool_to_base)
    target = pin.SE3(pose)
    around = chain.joints.home if near is None else _within(chain, near)
    wanted = None if all_solutions else 1
    exact: list[list[float]] = []
    guesses: list[list[float]] = []
    if closed is not None and closed.covers(task):
        exact, nearly = candidates(closed, pose)
        start = around[chain.moving]
        if task is Task.POSITION_AND_AXIS_5D:
            for x in exact:
                x[-1] = float(start[-1])
        within = closed.from_home if near is None else windows(chain, start)
        found = list(islice(_verified(chain, turned(exact, within), target, task, around), wanted))
        if found:
            return _answer(chain, found, around, analytic=True)
        guesses = list(turned(nearly, within))
    enough = _SAMPLE if all_solutions else 1 if near is None else _FEW
    found, nearest = _searched(
        chain,
        target,
        task,
        _begins(chain, target, around, exact, guesses, seed),
        around,
        enough=enough,
        # Whoever guesses in closed form has guessed every branch.
        soon=1 + len(guesses) if guesses else max(enough, _FEW_TRIES),
    )
    if found:
        return _answer(chain, found[:wanted], around, analytic=False)
    # What limits forbid may be allowed close by: a corner of them is hard to walk into.
    beyond = solutions_beyond(chain, target, task, exact, nearest, seed)
    corners = [nearest.x, *(clipped(chain, x) for x in beyond)]
    found, nearest = _searched(chain, target, task, corners, around, enough=enough, soon=len(corners))
    if found:
        return _answer(chain, found[:wanted], around, analytic=False)
    reason, nearest = reason_for_none(chain, target, task, beyond, nearest, around, seed)
    none = np.empty((0, len(around)))
    return InverseResult(none, nearest.residual_m, nearest.residual_rad, reason, analytic=False)


def follow(
    solver: InverseSolver, tool_to_base: ArrayLike, *, task: Task, near: ArrayLike
) -> FloatArray | None:
    """The joint positions (n,) that the arm comes to from `near` without changing its branch.

    Returns:
        None: there are none close by: a joint would have to move by more than 0.5 rad or m.

    Raises:
        PoseError, JointCountError: As `solve`.
    """
    chain = solver.chain
    target = pin.SE3(tool_pose(tool_to_base))
    around = _within(chain, near)
    found = descend(chain, target, task.rows, around[chain.moving])
    moved = np.abs(found.x - around[chain.moving])
    if not found.near_enough or moved.max(initial=0.0) > _BRANCH or not _allowed(chain, found.x, around):
        return None
    return _positions(chain, found.x, around)


def _within(chain: Chain, near: ArrayLike) -> FloatArray:
    positions = as_positions(chain.joints, near)
    if not np.isfinite(positions).all():
        raise PoseError(f"is asked for near {positions.tolist()}, where a number is not finite")
    return np.minimum(np.maximum(positions, chain.joints.lower), chain.joints.upper)


def _verified(
    chain: Chain, found: Iterable[list[float]], target: Any, task: Task, around: FloatArray
) -> Iterator[Found]:
    """Those that put the tool there, made better where rounding spoilt them; each once."""
    told: list[FloatArray] = []
    for each in found:
        x = clipped(chain, np.array(each))
        here = Found(x, *placement_misses(chain, x, target, task.rows))
        if here.residual_m > EXACT or here.residual_rad > EXACT:
            here = descend(chain, target, task.rows, x)
        if not here.near_enough or (told and any(np.abs(here.x - other).max() < _SAME for other in told)):
            continue
        if _allowed(chain, here.x, around):
            told.append(here.x)
            yield here


def _begins(
    chain: Chain,
    target: Any,
    around: FloatArray,
    exact: list[list[float]],
    guesses: list[list[float]],
    seed: int,
) -> Iterator[FloatArray]:
    """Where a search begins: where the arm is, at guesses, at home, anywhere."""
    first = [around[chain.moving], *map(np.array, guesses)]
    in_vain = bool(exact) or beyond_reach(chain, target)
    return islice(joined(first, starts(chain, seed)), len(first) + (_FEW_TRIES if in_vain else _TRIES))


def _searched(
    chain: Chain,
    target: Any,
    task: Task,
    begins: Iterable[FloatArray],
    around: FloatArray,
    *,
    enough: int,
    soon: int,
) -> tuple[list[Found], Found]:
    """Solutions that are found from one of `begins`, the nearest first; and what came nearest to one.

    Args:
        enough: So many will do.
        soon: After so many descents one will do; and one that the search could not make exact.
    """
    found: list[Found] = []
    rough: list[Found] = []
    nearest: Found | None = None
    for number, begin in enumerate(begins):
        here = descend(chain, target, task.rows, begin)
        if nearest is None or here.squared < nearest.squared:
            nearest = here
        if here.near_enough and _allowed(chain, here.x, around):
            kept = found if here.exact else rough
            if all(np.abs(here.x - other.x).max() > _SAME for other in kept):
                kept.append(here)
        if len(found) >= enough or (found and number == 0 and enough <= _FEW):
            break
        if (found or rough) and number + 1 >= soon:
            break
    assert nearest is not None
    start = around[chain.moving]
    weights = np.array([weight for _, _, weight in chain.limits])
    return sorted(found or rough, key=lambda each: float(np.square(each.x - start) @ weights)), nearest


def _allowed(chain: Chain, x: FloatArray, around: FloatArray) -> bool:
    """Whether coupled limits allow what each joint's own do."""
    constraints = chain.joints.constraints
    if not constraints:
        return True
    positions = _positions(chain, x, around)
    return all(
        each.lower - EXACT <= float(each.coefficients.dot(positions)) <= each.upper + EXACT
        for each in constraints
    )


def _positions(chain: Chain, x: FloatArray, around: FloatArray) -> FloatArray:
    if len(x) == len(around):
        return x
    positions = around.copy()
    positions[chain.moving] = x
    return positions


def _answer(chain: Chain, found: list[Found], around: FloatArray, *, analytic: bool) -> InverseResult:
    return InverseResult(
        np.array([_positions(chain, each.x, around) for each in found]),
        max([each.residual_m for each in found]),
        max([each.residual_rad for each in found]),
        "",
        analytic,
    )
