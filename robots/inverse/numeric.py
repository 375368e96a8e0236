"""Numeric inverse kinematics: Levenberg-Marquardt from several starts.

Each step solves (J^T J + w E) dx = J^T e, E = |e|^2 / 2. The damping decreases with the error, so the last
steps are Newton steps.

Source: Sugihara 2011, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method".
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import atan2, hypot, pi
from typing import Any

import eigenpy
import numpy as np
import pinocchio as pin

from robots.inverse.chain import Chain, placement_misses
from robots.inverse.tasks import TOLERANCE_M, TOLERANCE_RAD
from robots.joints import FloatArray

# Steps of one descent, and the weight of its damping; tuned on UR5, Panda and Puma 560.
_STEPS = 60
_DAMPING = 0.02
# Squared errors [m^2 + rad^2] at the level of rounding: the end of a descent, and an exact result.
_EXACT = 1e-24
_AS_EXACT = 1e-18
# Weight of a radian in metres if the position has priority.
_ORIENTATION = 3e-3
# A descent ends if this number of steps has not halved its squared error.
_PATIENCE = 6
_LOCAL = pin.ReferenceFrame.LOCAL


@dataclass(frozen=True, eq=False)
class Found:
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
) -> Found:
    """Minimize the deviation from a target, from a start.

    Args:
        target: A pin.SE3, tool to base.
        rows: Compared rows: 6 for the pose, 5 for position and axis, 3 for the position.
        x: (m,) the start.
        limited: Stay within limits.
        place_first: Give the position priority over the orientation.
    """
    model, data, frame = chain._model, chain._data, chain._frame
    # The Jacobian's computation places the tool as well: iMf holds the links' placements relative to it.
    placement = data.iMf[0]
    factors, offsets = chain._factors, chain._offsets
    wide = len(x) > rows
    identity = np.eye(rows if wide else len(x))
    factor = eigenpy.LLT(len(identity))
    mark, patience, stopped = np.inf, _PATIENCE, False
    for _ in range(_STEPS):
        q = x if factors is None else factors @ x + offsets
        jacobian = pin.computeFrameJacobian(model, data, q, frame, _LOCAL)
        away = placement.actInv(target)
        error = pin.log6(away).vector if rows == 6 else _axis_error(away)[:rows]
        if place_first:
            error[3:] *= _ORIENTATION
        squared = float(error.dot(error))
        if squared < _EXACT:
            break
        if squared < 0.5 * mark:
            mark, patience = squared, _PATIENCE
        else:
            patience -= 1
            if not patience:
                break
        # Pinocchio returns a 1-D array for one joint.
        jacobian = jacobian.reshape(6, -1)[:rows]
        if factors is not None:
            jacobian = jacobian @ factors
        if place_first:
            jacobian = jacobian * np.where(np.arange(rows) < 3, 1.0, _ORIENTATION)[:, None]
        if stopped:
            # Exclude joints that a limit stops: otherwise the steps of the other joints are too short.
            pull = error.dot(jacobian)
            jacobian = jacobian * ~(((x >= chain.upper) & (pull > 0)) | ((x <= chain.lower) & (pull < 0)))
        damping = (_DAMPING * squared + 1e-14) * identity
        turned = jacobian.T
        if wide:
            factor.compute(jacobian.dot(turned) + damping)
            step = x + turned.dot(factor.solve(error))
        else:
            factor.compute(turned.dot(jacobian) + damping)
            # The solver too returns a different shape for one joint.
            step = x + factor.solve(turned.dot(error)).reshape(-1)
        x = clipped(chain, step) if limited else step
        stopped = limited and x.tolist() != step.tolist()  # a quarter of the time of comparing the arrays
    return Found(x, *placement_misses(chain, x, target, rows))


def clipped(chain: Chain, x: FloatArray) -> FloatArray:
    """Clip each position of x to its limits."""
    return np.minimum(np.maximum(x, chain.lower), chain.upper)


def _axis_error(away: Any) -> FloatArray:
    """Return the error of the position and the tool's z axis: (5,) in the tool's frame."""
    x, y, z = away.translation.tolist()
    sideways, upwards, along = away.rotation[:, 2].tolist()
    across = hypot(sideways, upwards)
    if across < 1e-300:
        # The axes are parallel or opposite. For opposite axes any rotation axis will do: take x.
        return np.array((x, y, z, 0.0 if along > 0 else pi, 0.0))
    turn = atan2(across, along) / across
    return np.array((x, y, z, -upwards * turn, sideways * turn))


def starts(chain: Chain, seed: int) -> Iterator[FloatArray]:
    """Yield starts of a search: home, then random positions within limits, reproducible by the seed."""
    yield chain.home
    random = np.random.default_rng(seed)
    while True:
        yield random.uniform(chain.lower, chain.upper)
