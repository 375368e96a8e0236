"""Numeric inverse kinematics: Levenberg-Marquardt from several starts.

Each step solves (J^T J + w E) dx = J^T e, E = |e|^2 / 2. The damping decreases with the error, so the last
steps are Newton steps.

Source: Sugihara 2011, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method".
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count
from math import atan2, hypot, pi
from typing import Any

import eigenpy
import numpy as np
import pinocchio as pin

from robots.kinematics.inverse.chain import Chain, aim
from robots.kinematics.inverse.tasks import TOLERANCE_M, TOLERANCE_RAD, misses
from robots.kinematics.joints import FloatArray

# Steps of one descent, and the weight of its damping; tuned on UR5, Panda and Puma 560.
_STEPS = 60
_DAMPING = 0.02
# Squared errors [m^2 + rad^2] at the level of rounding: the end of a descent, and an exact result.
_EXACT = 1e-24
_AS_EXACT = 1e-18
# Weight of a radian in metres if the position has priority.
_ORIENTATION = 3e-3
# Random starts in the inner part of the joints' ranges, and this part's share; tuned on six arms. With more
# of them, poses at the limits take longer.
_INNER_STARTS = 4
_INNER_SHARE = 0.7
# A descent ends if this number of steps has not halved its squared error.
_PATIENCE = 6
_LOCAL = pin.ReferenceFrame.LOCAL


@dataclass(frozen=True, eq=False)
class DescentEnd:
    """The end of a descent: x (m,) [rad] or [m], and the tool's deviation from its target there."""

    x: FloatArray
    residual_m: float
    residual_rad: float

    @property
    def near_enough(self) -> bool:
        """True if the deviation is within the tolerances of a solution."""
        return self.residual_m <= TOLERANCE_M and self.residual_rad <= TOLERANCE_RAD

    @property
    def exact(self) -> bool:
        """True if the deviation is at the level of rounding."""
        return self.squared < _AS_EXACT

    @property
    def squared(self) -> float:
        """Squared error [m^2 + rad^2], which the search minimizes."""
        return self.residual_m**2 + self.residual_rad**2


def descend(
    chain: Chain, target: Any, rows: int, x: FloatArray, *, limited: bool = True, place_first: bool = False
) -> DescentEnd:
    """Minimize the deviation from a target, from a start.

    Args:
        target: A pin.SE3, tool to base.
        rows: Compared rows: 6 for the pose, 5 for position and axis, 3 for the position.
        x: (m,) the start.
        limited: Stay within limits.
        place_first: Give the position priority over the orientation.
    """
    aim(chain, target)
    model, data, frame, placement = chain._model, chain._data, chain._frame, chain._placement_with_jacobian
    factors, offsets = chain._factors, chain._offsets
    wide = len(x) > rows
    size = rows if wide else len(x)
    normal = np.empty((size, size))
    diagonal = normal.reshape(-1)[:: size + 1]
    factor = eigenpy.LLT(size)
    weights = np.where(np.arange(rows) < 3, 1.0, _ORIENTATION) if place_first else None
    mark, patience, stopped = np.inf, _PATIENCE, False
    for steps_left in range(_STEPS, -1, -1):
        q = x if factors is None else factors @ x + offsets
        jacobian = pin.computeFrameJacobian(model, data, q, frame, _LOCAL)
        error = pin.log6(placement).vector if rows == 6 else _axis_error(placement.inverse())[:rows]
        if weights is not None:
            error *= weights
        squared = float(error.dot(error))
        if squared < _EXACT:
            break
        if squared < 0.5 * mark:
            mark, patience = squared, _PATIENCE
        else:
            patience -= 1
        if not (patience and steps_left):
            break
        if jacobian.ndim == 1 or rows < 6:
            # Pinocchio returns a 1-D array for one joint.
            jacobian = jacobian.reshape(6, -1)[:rows]
        if factors is not None:
            jacobian = jacobian @ factors
        if weights is not None:
            jacobian = jacobian * weights[:, None]
        slope = error.dot(jacobian)
        if stopped:
            # Exclude joints that a limit stops: otherwise the steps of the other joints are too short.
            for joint in _held(chain, x, slope):
                jacobian[:, joint] = slope[joint] = 0.0
        turned = jacobian.T
        if wide:
            jacobian.dot(turned, normal)
            diagonal += _DAMPING * squared + 1e-14
            step = x - turned.dot(factor.compute(normal).solve(error))
        else:
            turned.dot(jacobian, normal)
            diagonal += _DAMPING * squared + 1e-14
            step = x - factor.compute(normal).solve(slope)
        if step.ndim != 1:
            # The solver too returns a different shape for one joint.
            step = step.reshape(-1)
        x = clipped(chain, step) if limited else step
        stopped = limited and x.tobytes() != step.tobytes()  # a fifth of the time of comparing the arrays
    return DescentEnd(x, *misses(placement.homogeneous.ravel().tolist(), rows))


def _held(chain: Chain, x: FloatArray, slope: FloatArray) -> list[int]:
    """Return the joints at a limit whose motion beyond it would reduce the error.

    Uses Python numbers: for so few, array operations take three times as long.
    """
    return [
        joint
        for joint, (at, rise, (lower, upper, _)) in enumerate(
            zip(x.tolist(), slope.tolist(), chain.limits, strict=True)
        )
        if (at >= upper if rise < 0 else at <= lower and rise > 0)
    ]


def clipped(chain: Chain, x: FloatArray) -> FloatArray:
    """Clip each position of x to its limits."""
    return np.minimum(np.maximum(x, chain.lower), chain.upper)


def _axis_error(away: Any) -> FloatArray:
    """Return the error of the position and the tool's z axis: (5,) in the tool's frame.

    Args:
        away: A pin.SE3, target to tool.
    """
    x, y, z = away.translation.tolist()
    sideways, upwards, along = away.rotation[:, 2].tolist()
    across = hypot(sideways, upwards)
    if across < 1e-300:
        # The axes are parallel or opposite. For opposite axes any rotation axis will do: take x.
        return np.array((-x, -y, -z, 0.0 if along > 0 else pi, 0.0))
    turn = atan2(across, along) / across
    return np.array((-x, -y, -z, upwards * turn, -sideways * turn))


def starts(chain: Chain, seed: int) -> Iterator[FloatArray]:
    """Yield starts of a search: home, then random positions within limits, reproducible by the seed.

    The first random ones are away from the limits, at which joints stop.
    """
    yield chain.home
    random = np.random.default_rng(seed)
    ranges, middle = chain.upper - chain.lower, (chain.lower + chain.upper) / 2
    for number in count():
        x = chain.lower + ranges * random.random(len(ranges))  # uniform() takes six times as long
        yield middle + _INNER_SHARE * (x - middle) if number < _INNER_STARTS else x
