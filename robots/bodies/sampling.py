"""Random joint positions within a robot's limits."""

import numpy as np

from robots.kinematics.joints import FloatArray, Joints, constraint_values

# A pair that touches in 0.1 % of all positions is missed with a probability of 1 in 22,000.
SAMPLES = 10_000
# Walks within coupled limits: rounds, and steps per joint in each. A round uses the shape from the previous.
_ROUNDS, _STEPS_A_JOINT = 4, 12


def allowed_positions(joints: Joints, samples: int, seed: int = 0) -> FloatArray:
    """Return home, then uniformly distributed joint positions within all limits: (count, n) [rad] or [m].

    Only home is returned if the constraints leave no other position.

    Coupled limits cut the box of the limits to a polytope, which may be very thin. Each position is the end
    of a separate walk from home; each step goes to a random point on a line in a random direction, within the
    polytope. Directions are scaled by the polytope's shape (Dikin's ellipsoid about the mean of all walks so
    far), so that the walks are as fast in a thin polytope.

    Source: Smith 1984 (hit and run); Kannan, Narayanan 2012 (Dikin walks).
    """
    random = np.random.default_rng(seed)
    size = joints.upper - joints.lower
    if not joints.constraints:
        others = random.uniform(joints.lower, joints.upper, (samples - 1, len(joints)))
        return np.vstack([joints.home, others])
    # In units of each joint's range. Walls: normal . position <= height.
    sums = np.array([constraint.coefficients * size for constraint in joints.constraints])
    one = np.eye(len(joints))
    normals = np.concatenate([one, -one, sums, -sums])
    origin = constraint_values(joints, joints.lower)
    upper = np.array([constraint.upper for constraint in joints.constraints]) - origin
    lower = np.array([constraint.lower for constraint in joints.constraints]) - origin
    heights = np.concatenate([np.ones(len(joints)), np.zeros(len(joints)), upper, -lower])
    positions = np.tile((joints.home - joints.lower) / size, (samples - 1, 1))
    stretch = one
    for _ in range(_ROUNDS):
        for _ in range(_STEPS_A_JOINT * len(joints)):
            positions = _step(positions, normals, heights, stretch, random)
        slack = heights - normals @ positions.mean(axis=0)
        if (slack <= 0).any():
            return joints.home[None]
        _, thinness, axes = np.linalg.svd(normals / slack[:, None], full_matrices=False)
        stretch = axes.T / thinness
    return np.vstack([joints.home, joints.lower + positions * size])


def _step(
    positions: FloatArray,
    normals: FloatArray,
    heights: FloatArray,
    stretch: FloatArray,
    random: np.random.Generator,
) -> FloatArray:
    """Move each position (count, n) to a random point of a line through it, within all walls."""
    directions = random.standard_normal(positions.shape) @ stretch.T
    towards = directions @ normals.T
    slack = np.maximum(heights - positions @ normals.T, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = slack / towards
    ahead = np.where(towards > 0, reach, np.inf).min(axis=1)
    behind = np.where(towards < 0, reach, -np.inf).max(axis=1)
    moved: FloatArray = positions + random.uniform(behind, ahead)[:, None] * directions
    return moved
