"""How far an arm is from a singular position: one in which its tool cannot move, or turn, some way."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from robots.joints import FloatArray
from robots.kinematic_tree import BASE, chain_to, tool_frame, tree_of
from robots.model import RobotModel, tool_jacobian
from robots.schema import JointType, RobotDescription


def reach_of(description: RobotDescription) -> float:
    """The length of an arm stretched out, from its first joint to its tool [m]; 0: it has none."""
    tree = tree_of(description)
    on_link, tool_to_link = tool_frame(description)
    (link,) = (link for link in tree.links if link.name == on_link)
    numbers = chain_to(tree, link.joint)
    if link.joint == BASE:
        return 0.0
    # The first joint's place on the base is no part of the arm.
    steps = [tree.joints[number].joint_to_parent for number in numbers[1:]]
    lengths = [float(np.linalg.norm(step[:3, 3])) for step in (*steps, link.link_to_joint @ tool_to_link)]
    strokes = [
        max(abs(joint.lower), abs(joint.upper))
        for joint in (tree.joints[number] for number in numbers)
        if joint.type is JointType.PRISMATIC
    ]
    return sum(lengths) + sum(strokes)


def singularity_margin(model: RobotModel, joint_positions: ArrayLike, *, reach: float) -> float:
    """The smallest singular value of the tool's Jacobian, lengths counted in reaches: 0 where it is singular.

    Of six values, or of as many as the arm has joints: an arm of five is not singular for having five.

    Args:
        joint_positions: (n,) [rad] or [m].
        reach: As `reach_of` gives it [m].

    Raises:
        JointCountError: If there is not one value a joint.
    """
    jacobian = tool_jacobian(model, joint_positions)
    return float(singularity_margins(jacobian, model.joints.types, reach=reach))


def singularity_margins(jacobians: FloatArray, types: Sequence[JointType], *, reach: float) -> FloatArray:
    """As `singularity_margin`: (...,) of tools' Jacobians (..., 6, n).

    Args:
        types: Of the joints.
    """
    # Without units: metres, of the tool and of prismatic joints, become reaches.
    length = reach or 1.0
    rows = np.array([1 / length] * 3 + [1.0] * 3)[:, None]
    columns = np.array([length if kind is JointType.PRISMATIC else 1.0 for kind in types])
    margins: FloatArray = np.linalg.svd(jacobians * rows * columns, compute_uv=False)[..., -1]
    return margins
