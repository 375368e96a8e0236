"""Distance of an arm from a singular position, in which its tool cannot move or turn in some direction."""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from robots.kinematics.joints import FloatArray
from robots.kinematics.kinematic_tree import BASE, chain_to, tool_frame, tree_of
from robots.kinematics.model import RobotModel, tool_jacobian
from robots.schema.robot_toml import JointType, RobotDescription


def arm_length(description: RobotDescription) -> float:
    """Return the length of the stretched arm, from its first joint to its tool [m]; 0 without a joint."""
    tree = tree_of(description)
    on_link, tool_to_link = tool_frame(description)
    (link,) = (link for link in tree.links if link.name == on_link)
    numbers = chain_to(tree, link.joint)
    if link.joint == BASE:
        return 0.0
    # The offset of the first joint on the base is not part of the arm.
    steps = [tree.joints[number].joint_to_parent for number in numbers[1:]]
    lengths = [float(np.linalg.norm(step[:3, 3])) for step in (*steps, link.link_to_joint @ tool_to_link)]
    strokes = [
        max(abs(joint.lower), abs(joint.upper))
        for joint in (tree.joints[number] for number in numbers)
        if joint.type is JointType.PRISMATIC
    ]
    return sum(lengths) + sum(strokes)


def singularity_margin(model: RobotModel, joint_positions: ArrayLike, *, reach: float) -> float:
    """Return the smallest singular value of the tool's Jacobian, with lengths in units of the reach.

    It is 0 in a singular position. There are min(6, n) singular values, so an arm of five joints is not
    singular everywhere.

    Args:
        joint_positions: (n,) [rad] or [m].
        reach: From `arm_length` [m].

    Raises:
        JointCountError: If there is not one value per joint.
    """
    jacobian = tool_jacobian(model, joint_positions)
    return float(singularity_margins(jacobian, model.joints.types, reach=reach))


def singularity_margins(jacobians: FloatArray, types: tuple[JointType, ...], *, reach: float) -> FloatArray:
    """Return the `singularity_margin` of each Jacobian: (...,) for (..., 6, n).

    Args:
        types: The joints' types.
    """
    scaled = jacobians * _without_units(types, reach)
    margins = np.linalg.svd(scaled, compute_uv=False)[..., -1]
    return np.asarray(margins, dtype=np.float64)


def dexterity(jacobian: FloatArray, types: tuple[JointType, ...], *, reach: float) -> tuple[float, float]:
    """Return `manipulability` and `singularity_margin` of a Jacobian (6, n), by one decomposition."""
    both = np.array([jacobian, jacobian * _without_units(types, reach)])
    plain, scaled = np.linalg.svd(both, compute_uv=False).tolist()
    return math.prod(plain), scaled[-1]


@lru_cache
def _without_units(types: tuple[JointType, ...], reach: float) -> FloatArray:
    """Return factors (6, n) that divide a Jacobian's metres, of tool and prismatic joints, by the reach."""
    length = reach or 1.0
    rows = np.array([1 / length] * 3 + [1.0] * 3)[:, None]
    columns = np.array([length if kind is JointType.PRISMATIC else 1.0 for kind in types])
    factors: FloatArray = rows * columns
    return factors
