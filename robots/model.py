"""The kinematic model: where every link is, and how the tool moves. Pinocchio stays behind this module."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from robots.joints import FloatArray, Joints, as_positions, joints_of
from robots.kinematic_tree import TreeJoint, named_frames, position_factors, tree_of
from robots.schema import JointType, RobotDescription


@dataclass(frozen=True, eq=False)
class RobotModel:
    """A robot that can be asked where it is. One thread at a time: its workspace is reused by each call.

    Attributes:
        joints: Its joints, SI.
        link_names: Names of its links, base first.
        frame_names: Names of its other frames: "tool" first, then the description's named frames.
        _followers: How the positions of all joints follow from the robot's own; None: they are the same.
    """

    joints: Joints
    link_names: tuple[str, ...]
    frame_names: tuple[str, ...]
    _pinocchio: Any
    _workspace: Any
    _link_ids: tuple[int, ...]
    _frame_ids: tuple[int, ...]
    _followers: tuple[FloatArray, FloatArray] | None


def build_model(description: RobotDescription) -> RobotModel:
    """The kinematic model of a description."""
    tree = tree_of(description)
    model = pin.Model()
    model.name = description.name
    for joint in tree.joints:
        # Pinocchio counts joints from 1; its 0 is the base.
        model.addJoint(
            joint.parent + 1,
            joint_motion(joint),
            pin.SE3(joint.joint_to_parent),
            joint.name,
            np.full(1, np.inf),
            np.full(1, joint.max_speed),
            np.full(1, joint.lower),
            np.full(1, joint.upper),
        )
    links = {link.name: link for link in tree.links}
    link_ids = [_add_frame(model, link.name, link.joint + 1, link.link_to_joint) for link in tree.links]
    frame_ids = []
    frames = named_frames(description)
    for name, (on_link, frame_to_link) in frames.items():
        link = links[on_link]
        # A URDF may have a link of the tool's name: in Pinocchio each frame needs its own.
        label = f"{name} of the arm" if name in links else name
        frame_ids.append(_add_frame(model, label, link.joint + 1, link.link_to_joint @ frame_to_link))
    return RobotModel(
        joints=joints_of(description),
        link_names=tuple(links),
        frame_names=tuple(frames),
        _pinocchio=model,
        _workspace=model.createData(),
        _link_ids=tuple(link_ids),
        _frame_ids=tuple(frame_ids),
        _followers=position_factors(tree) if len(tree.free) < len(tree.joints) else None,
    )


def joint_motion(joint: TreeJoint) -> Any:
    """Pinocchio's kind of a joint; a continuous one too has one number for its position, as everywhere."""
    rotary = joint.type is JointType.ROTARY
    if joint.axis[2] == 1.0:
        return pin.JointModelRZ() if rotary else pin.JointModelPZ()
    return (
        pin.JointModelRevoluteUnaligned(joint.axis)
        if rotary
        else pin.JointModelPrismaticUnaligned(joint.axis)
    )


def _add_frame(model: Any, name: str, joint: int, frame_to_joint: FloatArray) -> int:
    return int(model.addFrame(pin.Frame(name, joint, 0, pin.SE3(frame_to_joint), pin.FrameType.OP_FRAME)))


def link_placements(model: RobotModel, joint_positions: ArrayLike) -> FloatArray:
    """Placement of every link in the base frame.

    Args:
        joint_positions: (n,) joint positions [rad] or [m].

    Returns:
        (number of links, 4, 4) homogeneous transforms, link to base, base first.

    Raises:
        JointCountError: If the array does not have one value a joint.

    Source: Chen, Zhang, Xue 2001, section 3.2.
    """
    _forward(model, joint_positions)
    return np.stack([_placement(model, frame) for frame in model._link_ids])


def frame_placements(model: RobotModel, joint_positions: ArrayLike) -> dict[str, FloatArray]:
    """Placement of the tool and of every named frame in the base frame: (4, 4), frame to base, by name.

    Raises:
        JointCountError: If there is not one value a joint.
    """
    _forward(model, joint_positions)
    return {
        name: _placement(model, frame)
        for name, frame in zip(model.frame_names, model._frame_ids, strict=True)
    }


def tool_placement(model: RobotModel, joint_positions: ArrayLike) -> FloatArray:
    """Placement of the tool: (4, 4), tool to base.

    Raises:
        JointCountError: If there is not one value a joint.
    """
    _forward(model, joint_positions)
    return _placement(model, model._frame_ids[0])


def tool_jacobian(model: RobotModel, joint_positions: ArrayLike) -> FloatArray:
    """How the tool moves with the joints.

    Args:
        joint_positions: (n,) joint positions [rad] or [m].

    Returns:
        (6, n): linear velocity of the tool's origin, then angular velocity, both along the base's axes,
        per unit of joint velocity.

    Raises:
        JointCountError: If there is not one value a joint.
    """
    positions = all_positions(model, joint_positions)
    jacobian = pin.computeFrameJacobian(
        model._pinocchio,
        model._workspace,
        positions,
        model._frame_ids[0],
        pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
    )
    # Pinocchio gives a 1-D array for a robot of one joint.
    each = np.array(jacobian, dtype=np.float64).reshape(6, len(positions))
    return each if model._followers is None else each @ model._followers[0]


def manipulability(model: RobotModel, joint_positions: ArrayLike) -> float:
    """Yoshikawa's measure of the tool's Jacobian: 0 where the arm is singular, m and rad mixed.

    The product of the singular values: `sqrt(det(J J^T))` from six joints on, `sqrt(det(J^T J))` below.
    """
    return float(np.prod(np.linalg.svd(tool_jacobian(model, joint_positions), compute_uv=False)))


def all_positions(model: RobotModel, joint_positions: ArrayLike) -> FloatArray:
    """Positions of the joints that follow others too."""
    positions = as_positions(model.joints, joint_positions)
    if model._followers is None:
        return positions
    factors, offsets = model._followers
    return factors @ positions + offsets


def _forward(model: RobotModel, joint_positions: ArrayLike) -> None:
    positions = all_positions(model, joint_positions)
    pin.framesForwardKinematics(model._pinocchio, model._workspace, positions)


def _placement(model: RobotModel, frame: int) -> FloatArray:
    return np.array(model._workspace.oMf[frame].homogeneous, dtype=np.float64)
