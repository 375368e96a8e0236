"""All solutions in closed form, for the families of arms that EAIK supports.

Source: Ostermeier, Kuelz, Althoff 2025, "Automatic geometric decomposition for analytical inverse
kinematics".
"""

import functools
import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf, pi
from typing import Any

import numpy as np
import pinocchio as pin

from robots.kinematics.inverse.chain import Chain, placement_misses
from robots.kinematics.inverse.tasks import Task
from robots.kinematics.joints import FloatArray

log = logging.getLogger(__name__)

_TURN = 2 * pi
# Tolerance of limits for rounding [rad].
_ROUNDING = 1e-9
# Largest deviation of an exact solution [m] and [rad]; others are refined or dropped.
EXACT = 1e-9
_TRIALS = 8

Windows = tuple[tuple[float, float, float, float], ...]


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """The closed-form solution of an arm.

    Attributes:
        rolls: The last joint rotates about the tool's z axis, so the 5d task leaves it free.
        from_home: The `windows` about home.
    """

    chain: Chain
    rolls: bool
    from_home: Windows
    _eaik: Any

    def covers(self, task: Task) -> bool:
        """Return whether the closed form gives all solutions of a task."""
        return task is Task.POSE_6D or (task is Task.POSITION_AND_AXIS_5D and self.rolls)


def closed_form(chain: Chain) -> ClosedForm | None:
    """Return the closed form of a chain; None if the arm or Python is unsupported, or verification fails."""
    if not (chain.serial and chain.rotary and len(chain.moving) in (5, 6)):
        return None
    eaik = _eaik()
    if eaik is None:
        return None
    joints_and_tool = np.vstack([np.zeros(3), chain.origins, chain.tool_to_base[:3, 3]])
    arm = eaik.Robot(chain.axes.T, np.diff(joints_and_tool, axis=0).T, chain.tool_to_base[:3, :3], [], True)
    if not arm.has_known_decomposition():
        return None
    axis, away = chain.tool_to_base[:3, 2], chain.tool_to_base[:3, 3] - chain.origins[-1]
    off_axis = np.abs([*np.cross(chain.axes[-1], axis), *np.cross(axis, away)]).max()
    form = ClosedForm(chain, bool(off_axis < 1e-9), windows(chain, chain.home), arm)
    random = np.random.default_rng(0)
    return (
        form
        if all(_recovers(form, random.uniform(-np.pi, np.pi, len(chain.moving))) for _ in range(_TRIALS))
        else None
    )


@functools.cache
def _eaik() -> Any:
    """Return EAIK's module; None, with one line of log, if it is not installed."""
    try:
        from eaik.pybindings import EAIK
    except ModuleNotFoundError:
        log.warning(
            "eaik is not installed, so inverse kinematics searches: slower, and it may miss a solution of "
            "several. To install it (Python 3.11 to 3.13): pip install --no-deps eaik"
        )
        return None
    return EAIK


def _recovers(form: ClosedForm, x: FloatArray) -> bool:
    """Return whether the closed form finds x again from its tool pose."""
    placement_misses(form.chain, x, pin.SE3.Identity(), 6)
    exact, _ = candidates(form, np.array(form.chain._placement.homogeneous))
    apart = [np.abs(np.remainder(found - x + np.pi, _TURN) - np.pi).max() for found in exact]
    return min(apart, default=np.inf) < 1e-6


def candidates(form: ClosedForm, tool_to_base: FloatArray) -> tuple[list[list[float]], list[list[float]]]:
    """Return positions (m,) [rad], ignoring limits, with arbitrary turns: solutions, and approximations."""
    found = form._eaik.calculate_IK(tool_to_base)
    exact: list[list[float]] = []
    guesses: list[list[float]] = []
    for x, guess in zip(found.Q.tolist(), found.is_LS.tolist(), strict=True):
        (guesses if guess else exact).append(x)
    return exact, guesses


def windows(chain: Chain, start: FloatArray) -> Windows:
    """Return for each joint the full turn within limits that is centred on the start, as far as limits allow.

    Returns:
        Its beginning and the upper limit [rad], both with a tolerance for rounding; the start; and the weight
        of a squared difference from the start.
    """
    return tuple(
        (
            max(lower - _ROUNDING, min(middle - pi, upper + _ROUNDING - _TURN)),
            upper + _ROUNDING,
            middle,
            weight,
        )
        for middle, (lower, upper, weight) in zip(start.tolist(), chain.limits, strict=True)
    )


def within_limits(found: Sequence[list[float]], within: Windows) -> Iterator[list[float]]:
    """Yield the solutions within limits, with each joint at the turn nearest to the start's.

    The nearest comes first, before the others are examined. The distance is the sum of squared differences,
    as shares of the joints' ranges.
    """
    nearer = _solutions_within(found, within, nearer_only=True)
    if nearer:
        yield nearer[-1][1]
        others = sorted(_solutions_within(found, within, nearer_only=False))
        others.remove(nearer[-1])
        for _, here in others:
            yield here


def _solutions_within(
    found: Sequence[list[float]], within: Windows, *, nearer_only: bool
) -> list[tuple[float, list[float]]]:
    """Return solutions within limits with their distance from the start.

    Uses Python numbers: for so few, one array operation takes as long as this function.

    Args:
        nearer_only: Return only solutions that are nearer than all before them.
    """
    kept = []
    least_distance = inf
    for each in found:
        here, distance = [], 0.0
        for position, (least, most, middle, weight) in zip(each, within):  # noqa: B905, a tenth of the time
            turn = (position - least) % _TURN + least
            if not turn <= most:  # true for NaN too
                break
            here.append(turn)
            turn -= middle
            distance += weight * turn * turn
            if distance > least_distance:
                break
        else:
            kept.append((distance, here))
            if nearer_only:
                least_distance = distance
    return kept
