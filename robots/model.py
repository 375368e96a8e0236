"""The kinematic model: where every link is, and how the tool moves. Pinocchio stays behind this module.

How a standard D-H row becomes a Pinocchio joint and a link's frame:

    joint i's placement = link frame of row i-1 (Trans(z, d) Trans(x, a) Rot(x, alpha)), then
        rotary:     Rot(z, theta), and the variable turns about z
        prismatic:  Rot(z, theta) Trans(z, d), and the variable moves along z
    link i's frame      = joint i, then Trans(z, d) Trans(x, a) Rot(x, alpha)  (prismatic: without d)

Source: Chen, Zhang, Xue 2001, section 3.2.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from robots.joints import FloatArray, Joints, angle_factor, as_positions, joints_of, length_factor
from robots.poses import dh_fixed_part, pose_matrix, rpy_rotation
from robots.schema import TOOL_FRAME, JointType, RobotDescription


@dataclass(frozen=True, eq=False)
class RobotModel:
    """A robot that can be asked where it is. One thread at a time: its workspace is reused by each call.

    Attributes:
        joints: Its joints, SI.
        link_names: Names of its links, base first.
        frame_names: Names of its other frames: "tool" first, then the description's named frames.
    """

    joints: Joints
    link_names: tuple[str, ...]
    frame_names: tuple[str, ...]
    _pinocchio: Any
    _workspace: Any
    _link_ids: tuple[int, ...]
    _frame_ids: tuple[int, ...]


def build_model(description: RobotDescription) -> RobotModel:
    """The kinematic model of a description."""
    model = pin.Model()
    model.name = description.name
    joints = joints_of(description)
    length, angle = length_factor(description.units), angle_factor(description.units)
    parent = 0
    before = np.eye(4)  # the parent joint's frame to its link's frame
    on_link = {"base": (0, before)}
    link_ids = [_add_frame(model, "base", 0, before)]
    for index, row in enumerate(description.joints):
        rotary = row.type is JointType.ROTARY
        theta, d = row.theta * angle, row.d * length
        turn = np.eye(4)
        turn[:3, :3] = rpy_rotation(0.0, 0.0, theta)
        fixed = dh_fixed_part(d if rotary else 0.0, row.a * length, row.alpha * angle)
        placement = before @ turn if rotary else before @ turn @ dh_fixed_part(d, 0.0, 0.0)
        parent = model.addJoint(
            parent,
            pin.JointModelRZ() if rotary else pin.JointModelPZ(),
            pin.SE3(placement),
            row.name,
            np.full(1, np.inf),
            joints.max_speed[index : index + 1],
            joints.lower[index : index + 1],
            joints.upper[index : index + 1],
        )
        link_ids.append(_add_frame(model, row.link_name, parent, fixed))
        on_link[row.link_name] = (parent, fixed)
        before = fixed
    frames = {TOOL_FRAME: (description.link_names[-1], pose_matrix(description.tool, description.units))}
    frames |= {
        frame.name: (frame.link, pose_matrix(frame, description.units)) for frame in description.frames
    }
    frame_ids = []
    for name, (link, frame_to_link) in frames.items():
        joint, link_to_joint = on_link[link]
        frame_ids.append(_add_frame(model, name, joint, link_to_joint @ frame_to_link))
    return RobotModel(
        joints=joints,
        link_names=description.link_names,
        frame_names=tuple(frames),
        _pinocchio=model,
        _workspace=model.createData(),
        _link_ids=tuple(link_ids),
        _frame_ids=tuple(frame_ids),
    )


def _add_frame(model: Any, name: str, joint: int, frame_to_joint: FloatArray) -> int:
    return int(model.addFrame(pin.Frame(name, joint, 0, pin.SE3(frame_to_joint), pin.FrameType.OP_FRAME)))


def link_placements(model: RobotModel, joint_positions: ArrayLike) -> FloatArray:
    """Placement of every link in the base frame.

    Args:
        joint_positions: (n,) joint positions [rad] or [m].

    Returns:
        (n + 1, 4, 4) homogeneous transforms, link to base, base first.

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
    positions = as_positions(model.joints, joint_positions)
    jacobian = pin.computeFrameJacobian(
        model._pinocchio,
        model._workspace,
        positions,
        model._frame_ids[0],
        pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
    )
    # Pinocchio gives a 1-D array for a robot of one joint.
    return np.array(jacobian, dtype=np.float64).reshape(6, len(model.joints))


def manipulability(model: RobotModel, joint_positions: ArrayLike) -> float:
    """Yoshikawa's measure of the tool's Jacobian: 0 where the arm is singular, m and rad mixed.

    The product of the singular values: `sqrt(det(J J^T))` from six joints on, `sqrt(det(J^T J))` below.
    """
    return float(np.prod(np.linalg.svd(tool_jacobian(model, joint_positions), compute_uv=False)))


def _forward(model: RobotModel, joint_positions: ArrayLike) -> None:
    positions = as_positions(model.joints, joint_positions)
    pin.framesForwardKinematics(model._pinocchio, model._workspace, positions)


def _placement(model: RobotModel, frame: int) -> FloatArray:
    return np.array(model._workspace.oMf[frame].homogeneous, dtype=np.float64)
