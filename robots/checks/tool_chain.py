"""Tool poses, Jacobians and travel bounds of an arm at many joint positions.

Vectorized, because Pinocchio computes one position per call and a program has tens of thousands.
"""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from robots.collision import Arm
from robots.collision.path import SAMPLE_M
from robots.kinematics.joints import FloatArray, JointType
from robots.kinematics.kinematic_tree import Tree, TreeLink, chain_to, position_factors, tool_frame, tree_of
from robots.kinematics.singularity import arm_length
from robots.schema.poses import axis_rotation


@dataclass(frozen=True, eq=False)
class ToolChain:
    """The joints between base and tool, with bounds of the arm's travel.

    Attributes:
        reach_m: The length of the stretched arm.
        travel: (b, n) upper bound of the travel of any point of a body or the tool per joint, in any
            position: [m/rad] or [m/m].
    """

    reach_m: float
    travel: FloatArray
    # Joints between base and tool: (4, 4) placement of each in the previous at position 0, axes, types.
    _placements: FloatArray
    _axes: FloatArray
    _rotary: tuple[bool, ...]
    _tool_to_joint: FloatArray
    # From the robot's joint positions to those of these joints.
    _factors: FloatArray
    _offsets: FloatArray


# By the arm: a chain takes as long as the check of a short motion.
_CHAINS: WeakKeyDictionary[Arm, ToolChain] = WeakKeyDictionary()


def tool_chain(arm: Arm) -> ToolChain:
    """Return the chain of an arm's tool."""
    if arm not in _CHAINS:
        _CHAINS[arm] = _build_chain(arm)
    return _CHAINS[arm]


def _build_chain(arm: Arm) -> ToolChain:
    tree = tree_of(arm.description)
    on_link, tool_to_link = tool_frame(arm.description)
    link = next(link for link in tree.links if link.name == on_link)
    numbers = list(chain_to(tree, link.joint))
    factors, offsets = position_factors(tree)
    balls = [
        (tree.links[number], body.center, float(np.linalg.norm(body.half)))
        for body, number in zip(arm.bodies, arm.links.tolist(), strict=True)
    ]
    strokes = _strokes(arm, tree, factors, offsets)
    travel = np.array([_travel(tree, *ball, strokes) for ball in (*balls, (link, tool_to_link[:3, 3], 0.0))])
    return ToolChain(
        reach_m=arm_length(arm.description),
        travel=travel @ np.abs(factors),
        _placements=np.array([tree.joints[number].joint_to_parent for number in numbers]).reshape(-1, 4, 4),
        _axes=np.array([tree.joints[number].axis for number in numbers]).reshape(-1, 3),
        _rotary=tuple(tree.joints[number].type is JointType.ROTARY for number in numbers),
        _tool_to_joint=link.link_to_joint @ tool_to_link,
        _factors=factors[numbers],
        _offsets=offsets[numbers],
    )


def _strokes(arm: Arm, tree: Tree, factors: FloatArray, offsets: FloatArray) -> FloatArray:
    """Return the (all joints,) largest stroke of each prismatic joint [m]; 0 for rotary joints."""
    farthest = np.abs(factors) @ np.maximum(np.abs(arm.joints.lower), np.abs(arm.joints.upper))
    prismatic = [joint.type is JointType.PRISMATIC for joint in tree.joints]
    return np.where(prismatic, farthest + np.abs(offsets), 0.0)


def _travel(tree: Tree, link: TreeLink, center: FloatArray, radius: float, strokes: FloatArray) -> FloatArray:
    """Return the (all joints,) upper bound of the travel of a ball's farthest point per joint.

    The distance from a joint to the ball is at most the sum of the parts between them. Of the first part,
    which rotates rigidly with the joint, only the component across the axis counts.
    """
    travel = np.zeros(len(tree.joints))
    beyond = radius
    after = link.link_to_joint[:3, :3] @ center + link.link_to_joint[:3, 3]
    for number in reversed(chain_to(tree, link.joint)):
        joint = tree.joints[number]
        across = float(np.linalg.norm(np.cross(joint.axis, after)))
        travel[number] = across + beyond if joint.type is JointType.ROTARY else 1.0
        beyond += float(np.linalg.norm(after)) + float(strokes[number])
        after = joint.joint_to_parent[:3, 3]
    return travel


def samples_between(chain: ToolChain, start: FloatArray, target: FloatArray) -> int:
    """Return the number of equal parts of a motion, so that no link moves more than SAMPLE_M in one."""
    farthest = float((chain.travel @ np.abs(target - start)).max())
    return max(int(np.ceil(farthest / SAMPLE_M)), 1)


def tools_and_jacobians(chain: ToolChain, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the tool's poses and Jacobians.

    Args:
        positions: (m, n) [rad] or [m].

    Returns:
        (m, 4, 4) tool to base, and (m, 6, n) Jacobians: linear, then angular, along the base's axes.
    """
    along_chain = positions @ chain._factors.T + chain._offsets
    count = len(positions)
    rotation, origin = np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3))
    axes, origins = [], []
    for number, rotary in enumerate(chain._rotary):
        placement, axis = chain._placements[number], chain._axes[number]
        origin = origin + rotation @ placement[:3, 3]
        rotation = rotation @ placement[:3, :3]
        along = rotation @ axis
        axes.append(along)
        if rotary:
            rotation = rotation @ axis_rotation(np.broadcast_to(axis, (count, 3)), along_chain[:, number])
        else:
            origin = origin + along_chain[:, number, None] * along
        origins.append(origin)
    tools = np.zeros((count, 4, 4))
    tools[:, :3, :3] = rotation @ chain._tool_to_joint[:3, :3]
    tools[:, :3, 3] = origin + rotation @ chain._tool_to_joint[:3, 3]
    tools[:, 3, 3] = 1.0
    jacobians = np.zeros((count, 6, len(axes)))
    for number, rotary in enumerate(chain._rotary):
        if rotary:
            jacobians[:, :3, number] = np.cross(axes[number], tools[:, :3, 3] - origins[number])
            jacobians[:, 3:, number] = axes[number]
        else:
            jacobians[:, :3, number] = axes[number]
    return tools, jacobians @ chain._factors
