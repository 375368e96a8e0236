"""The kinematic model: forward kinematics and the tool's Jacobian. Wraps Pinocchio."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from robots.kinematics.joints import FloatArray, Joints, as_positions, joints_of
from robots.kinematics.kinematic_tree import TreeJoint, named_frames, position_factors, tree_of
from robots.schema.robot_toml import JointType, RobotDescription

Pose = tuple[float, float, float, float, float, float, float]
"""Position x, y, z [m], and orientation as a unit quaternion x, y, z, w; w >= 0."""


@dataclass(frozen=True, eq=False)
class RobotModel:
    """A robot's kinematic model. Not thread-safe: every call uses the same workspace.

    Attributes:
        joints: The robot's joints, SI.
        link_names: Names of the links, base first.
        frame_names: Names of the other frames: "tool" first, then the description's named frames.
        _mimic: Factors and offsets from the robot's joint positions to those of all joints, including
            mimic joints; None without a mimic joint.
    """

    joints: Joints
    link_names: tuple[str, ...]
    frame_names: tuple[str, ...]
    _pinocchio: Any
    _workspace: Any
    _link_ids: tuple[int, ...]
    _frame_ids: tuple[int, ...]
    _mimic: tuple[FloatArray, FloatArray] | None


def build_model(description: RobotDescription) -> RobotModel:
    """Build the kinematic model of a description."""
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
        # A URDF link may have the tool's name, but frame names in Pinocchio must be unique.
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
        _mimic=position_factors(tree) if len(tree.free) < len(tree.joints) else None,
    )


def joint_motion(joint: TreeJoint) -> Any:
    """Return Pinocchio's model of a joint; a continuous joint has one position value too, as elsewhere."""
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
    """Return the placement of every link in the base frame.

    Args:
        joint_positions: (n,) joint positions [rad] or [m].

    Returns:
        (number of links, 4, 4) homogeneous transforms, link to base, base first.

    Raises:
        JointCountError: If the array does not have one value per joint.

    Source: Chen, Zhang, Xue 2001, section 3.2.
    """
    _forward(model, joint_positions)
    return _placements(model, model._link_ids)


def frame_placements(model: RobotModel, joint_positions: ArrayLike) -> dict[str, FloatArray]:
    """Return the placement of the tool and every named frame: (4, 4), frame to base, by name.

    Raises:
        JointCountError: If there is not one value per joint.
    """
    _forward(model, joint_positions)
    return dict(zip(model.frame_names, _placements(model, model._frame_ids), strict=True))


def all_placements(model: RobotModel, joint_positions: ArrayLike) -> FloatArray:
    """Return the placements of every link, and then of the tool and every named frame, in the base frame.

    Args:
        joint_positions: (n,) joint positions [rad] or [m].

    Returns:
        (number of links and frames, 4, 4), in the order of `link_names` and `frame_names`.

    Raises:
        JointCountError: If there is not one value per joint.
    """
    _forward(model, joint_positions)
    return _placements(model, (*model._link_ids, *model._frame_ids))


def all_poses(model: RobotModel, joint_positions: ArrayLike, base_to_site: FloatArray) -> list[Pose]:
    """Return `all_placements` in the site's frame, as poses.

    Args:
        joint_positions: (n,) joint positions [rad] or [m].
        base_to_site: (4, 4) placement of the base.

    Raises:
        JointCountError: If there is not one value per joint.
    """
    _forward(model, joint_positions)
    base, placed = pin.SE3(base_to_site), model._workspace.oMf
    return [_pose(base * placed[frame]) for frame in (*model._link_ids, *model._frame_ids)]


def placement_pose(placement: FloatArray) -> Pose:
    """Return a placement (4, 4) as a pose."""
    return _pose(pin.SE3(placement))


def tool_placement(model: RobotModel, joint_positions: ArrayLike) -> FloatArray:
    """Return the placement of the tool: (4, 4), tool to base.

    Raises:
        JointCountError: If there is not one value per joint.
    """
    _forward(model, joint_positions)
    placement: FloatArray = _placements(model, model._frame_ids[:1])[0]
    return placement


def tool_jacobian(model: RobotModel, joint_positions: ArrayLike) -> FloatArray:
    """Return the tool's Jacobian.

    Args:
        joint_positions: (n,) joint positions [rad] or [m].

    Returns:
        (6, n): linear velocity of the tool's origin, then angular velocity, both along the base's axes,
        per unit of joint velocity.

    Raises:
        JointCountError: If there is not one value per joint.
    """
    positions = all_positions(model, joint_positions)
    jacobian = pin.computeFrameJacobian(
        model._pinocchio,
        model._workspace,
        positions,
        model._frame_ids[0],
        pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
    )
    # Pinocchio returns a 1-D array for a robot of one joint.
    each = np.array(jacobian, dtype=np.float64).reshape(6, len(positions))
    return each if model._mimic is None else each @ model._mimic[0]


def manipulability(model: RobotModel, joint_positions: ArrayLike) -> float:
    """Return Yoshikawa's manipulability of the tool's Jacobian: 0 in a singular position, m and rad mixed.

    The product of the singular values: `sqrt(det(J J^T))` from six joints on, `sqrt(det(J^T J))` below.
    """
    return float(np.prod(np.linalg.svd(tool_jacobian(model, joint_positions), compute_uv=False)))


def all_positions(model: RobotModel, joint_positions: ArrayLike) -> FloatArray:
    """Return the positions of all joints, including mimic joints."""
    positions = as_positions(model.joints, joint_positions)
    if model._mimic is None:
        return positions
    factors, offsets = model._mimic
    return factors @ positions + offsets


def _forward(model: RobotModel, joint_positions: ArrayLike) -> None:
    positions = all_positions(model, joint_positions)
    pin.framesForwardKinematics(model._pinocchio, model._workspace, positions)


def _pose(placement: Any) -> Pose:
    x, y, z, *turn = pin.SE3ToXYZQUATtuple(placement)
    i, j, k, w = turn if turn[3] >= 0.0 else (-each for each in turn)
    return x, y, z, i, j, k, w


def _placements(model: RobotModel, frames: Sequence[int]) -> FloatArray:
    # Pinocchio's property takes longer than the frames.
    placed = model._workspace.oMf
    return np.array([placed[frame].homogeneous for frame in frames], dtype=np.float64)
