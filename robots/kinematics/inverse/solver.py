"""Solver for joint positions of a tool pose: in closed form if the arm has one, otherwise by search."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.kinematics.inverse.chain import Chain, build_chain, placement_misses
from robots.kinematics.inverse.closed_form import (
    EXACT,
    ClosedForm,
    candidates,
    closed_form,
    windows,
    within_limits,
)
from robots.kinematics.inverse.numeric import DescentEnd, clipped, descend, starts
from robots.kinematics.inverse.reasons import beyond_reach, reason_for_none, solutions_beyond
from robots.kinematics.inverse.tasks import Task, tool_pose
from robots.kinematics.joints import FloatArray, as_positions
from robots.schema.errors import PoseError
from robots.schema.robot_toml import RobotDescription

# Descents until a search gives up, and solutions that are enough in a search for all.
_TRIES = 300
_SAMPLE = 100
# Descents if a solution is unlikely, or if one is known and a better one may exist.
_FEW_TRIES = 20
# Solutions to find before the nearest is chosen, unless the descent from `near` already gives one.
_FEW = 3
# Solutions within this distance are equal [rad] or [m].
_SAME = 1e-6
# A larger joint step between two poses of a line leads to another branch [rad] or [m].
_BRANCH = 0.5


@dataclass(frozen=True, eq=False)
class InverseSolver:
    """Inverse kinematics of a robot. Not thread-safe: every call uses the same workspace.

    Attributes:
        chain: The joints that move the tool.
        closed: The closed form; None without one.
    """

    chain: Chain
    closed: ClosedForm | None


@dataclass(frozen=True, eq=False)
class InverseResult:
    """The result of inverse kinematics.

    Attributes:
        solutions: (k, n) joint positions [rad] or [m], the nearest first; all verified.
        residual_m: The tool's distance from its target at the worst solution; without a solution, at the
            nearest position found.
        residual_rad: The same for the orientation or axis.
        reason: The reason for no solution; None with a solution.
        analytic: The solutions are in closed form and cover every branch, each at the nearest turns.
    """

    solutions: FloatArray
    residual_m: float
    residual_rad: float
    reason: Reason | None
    analytic: bool


def build_solver(description: RobotDescription) -> InverseSolver:
    """Build a solver for a description's tool."""
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
    """Find the joint positions within limits that put the tool at a pose: the nearest to `near`, or all.

    Deterministic: equal arguments give equal results. In a search, "the nearest" and "all" refer to the
    solutions that it found.

    Args:
        tool_to_base: (4, 4) or 16 numbers by rows [m].
        near: (n,) joint positions [rad] or [m]; None: home. Joints that do not move the tool stay there.
        seed: Seed of the search's starts.

    Raises:
        PoseError: If the pose is invalid, or `near` holds a number that is not finite.
        JointCountError: If `near` does not have one value per joint.
    """
    chain, closed = solver.chain, solver.closed
    pose = tool_pose(tool_to_base)
    target = pin.SE3(pose)
    around = chain.joints.home if near is None else _clipped_start(chain, near)
    wanted = None if all_solutions else 1
    exact: list[list[float]] = []
    guesses: list[list[float]] = []
    if closed is not None and closed.covers(task):
        exact, approximate = candidates(closed, pose)
        start = around[chain.moving]
        if task is Task.POSITION_AND_AXIS_5D:
            for x in exact:
                x[-1] = float(start[-1])
        within = closed.from_home if near is None else windows(chain, start)
        found = list(islice(_verify(chain, within_limits(exact, within), target, task, around), wanted))
        if found:
            return _answer(chain, found, around, analytic=True)
        guesses = list(within_limits(approximate, within))
    enough = _SAMPLE if all_solutions else 1 if near is None else _FEW
    found, nearest = _search(
        chain,
        target,
        task,
        _search_starts(chain, target, around, exact, guesses, seed),
        around,
        enough=enough,
        # The approximations of the closed form cover every branch.
        soon=1 + len(guesses) if guesses else max(enough, _FEW_TRIES),
    )
    if found:
        return _answer(chain, found[:wanted], around, analytic=False)
    # A corner of the limits is hard to reach by descent: start from solutions beyond limits, clipped to them.
    beyond = solutions_beyond(chain, target, task, exact, nearest, seed)
    corners = [nearest.x, *(clipped(chain, x) for x in beyond)]
    found, nearest = _search(chain, target, task, corners, around, enough=enough, soon=len(corners))
    if found:
        return _answer(chain, found[:wanted], around, analytic=False)
    reason, nearest = reason_for_none(chain, target, task, beyond, nearest, around, seed)
    none = np.empty((0, len(around)))
    return InverseResult(none, nearest.residual_m, nearest.residual_rad, reason, analytic=False)


def follow(
    solver: InverseSolver, tool_to_base: ArrayLike, *, task: Task, near: ArrayLike
) -> FloatArray | None:
    """Return the joint positions (n,) of a pose on the branch of `near`.

    Returns:
        None if there are none close by: a joint would have to move by more than 0.5 rad or m.

    Raises:
        PoseError, JointCountError: See `solve`.
    """
    chain = solver.chain
    target = pin.SE3(tool_pose(tool_to_base))
    around = _clipped_start(chain, near)
    found = descend(chain, target, task.rows, around[chain.moving])
    moved = np.abs(found.x - around[chain.moving])
    if not found.near_enough or moved.max(initial=0.0) > _BRANCH or not _allowed(chain, found.x, around):
        return None
    return _positions(chain, found.x, around)


def _clipped_start(chain: Chain, near: ArrayLike) -> FloatArray:
    positions = as_positions(chain.joints, near)
    if not np.isfinite(positions).all():
        raise PoseError(codes.POSE_NEAR_NOT_FINITE(positions=positions.tolist()))
    return np.minimum(np.maximum(positions, chain.joints.lower), chain.joints.upper)


def _verify(
    chain: Chain, found: Iterable[list[float]], target: Any, task: Task, around: FloatArray
) -> Iterator[DescentEnd]:
    """Yield each solution that puts the tool at the target once, refined if rounding made it inexact."""
    known: list[FloatArray] = []
    for each in found:
        x = clipped(chain, np.array(each))
        here = DescentEnd(x, *placement_misses(chain, x, target, task.rows))
        if here.residual_m > EXACT or here.residual_rad > EXACT:
            here = descend(chain, target, task.rows, x)
        if not here.near_enough or (known and any(np.abs(here.x - other).max() < _SAME for other in known)):
            continue
        if _allowed(chain, here.x, around):
            known.append(here.x)
            yield here


def _search_starts(
    chain: Chain,
    target: Any,
    around: FloatArray,
    exact: list[list[float]],
    guesses: list[list[float]],
    seed: int,
) -> Iterator[FloatArray]:
    """Yield the starts of a search: the arm's position, approximations, home, random positions."""
    yield around[chain.moving]
    yield from map(np.array, guesses)
    unlikely = bool(exact) or beyond_reach(chain, target)
    others = islice(starts(chain, seed), _FEW_TRIES if unlikely else _TRIES)
    if around is chain.joints.home:
        next(others)
    yield from others


def _search(
    chain: Chain,
    target: Any,
    task: Task,
    begins: Iterable[FloatArray],
    around: FloatArray,
    *,
    enough: int,
    soon: int,
) -> tuple[list[DescentEnd], DescentEnd]:
    """Search from each of `begins`; return the solutions, nearest first, and the best descent.

    Args:
        enough: Number of solutions at which the search ends.
        soon: Number of descents after which one solution is enough, even one that is not exact.
    """
    found: list[DescentEnd] = []
    rough: list[DescentEnd] = []
    nearest: DescentEnd | None = None
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
    kept = found or rough
    if len(kept) > 1:
        start = around[chain.moving]
        weights = np.array([weight for _, _, weight in chain.limits])
        kept.sort(key=lambda each: float(np.square(each.x - start) @ weights))
    return kept, nearest


def _allowed(chain: Chain, x: FloatArray, around: FloatArray) -> bool:
    """Return whether the coupled limits allow x, which is within each joint's limits."""
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


def _answer(chain: Chain, found: list[DescentEnd], around: FloatArray, *, analytic: bool) -> InverseResult:
    return InverseResult(
        np.array([_positions(chain, each.x, around) for each in found]),
        max([each.residual_m for each in found]),
        max([each.residual_rad for each in found]),
        None,
        analytic,
    )
