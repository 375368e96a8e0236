"""Pinocchio model of only the joints that move the tool."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from robots.kinematics.inverse.tasks import misses
from robots.kinematics.joints import FloatArray, Joints, joints_of
from robots.kinematics.kinematic_tree import chain_to, position_factors, tool_frame, tree_of
from robots.kinematics.model import joint_motion
from robots.schema.robot_toml import JointType, RobotDescription


@dataclass(frozen=True, eq=False)
class Chain:
    """The joints between the base and the tool. Not thread-safe: every call uses the same workspace.

    In this module, `x` is (m,): positions of the robot's joints that move the tool, [rad] or [m].

    Attributes:
        joints: All joints of the robot.
        moving: (m,) numbers of the joints that move the tool, in the robot's order.
        lower, upper, home: (m,).
        limits: Lower and upper limit of each joint, and the weight of its squared difference: 1 / range^2.
        rotary: Whether all joints of the chain are rotary.
        serial: Whether the chain has no mimic joint.
        axes, origins: (c, 3) of the chain's joints in the base frame, at position zero [m].
        tool_to_base: (4, 4) at position zero.
        reach: Upper bound of the tool's distance from the first joint, ignoring rotary limits [m].
        _placement: The tool, relative to the target of `aim`, from the last forward kinematics.
        _placement_with_jacobian: The same from the last Jacobian, whose computation places the tool as well.
        _base: The first joint in the base frame.
    """

    joints: Joints
    moving: NDArray[np.intp]
    lower: FloatArray
    upper: FloatArray
    home: FloatArray
    limits: tuple[tuple[float, float, float], ...]
    rotary: bool
    serial: bool
    axes: FloatArray
    origins: FloatArray
    tool_to_base: FloatArray
    reach: float
    _model: Any
    _data: Any
    _frame: int
    _placement: Any
    _placement_with_jacobian: Any
    _base: Any
    _factors: FloatArray | None
    _offsets: FloatArray


def build_chain(description: RobotDescription) -> Chain:
    """Build the chain of a description's tool."""
    tree, joints = tree_of(description), joints_of(description)
    on_link, tool_to_link = tool_frame(description)
    link = next(link for link in tree.links if link.name == on_link)
    numbers = chain_to(tree, link.joint)
    factors, offsets = (each[list(numbers)] for each in position_factors(tree))
    moving = np.flatnonzero((factors != 0).any(axis=0))
    factors = factors[:, moving]
    model = pin.Model()
    parent = 0
    for joint in (tree.joints[number] for number in numbers):
        parent = model.addJoint(parent, joint_motion(joint), pin.SE3(joint.joint_to_parent), joint.name)
    tool = pin.Frame("tool", parent, 0, pin.SE3(link.link_to_joint @ tool_to_link), pin.FrameType.OP_FRAME)
    frame = model.addFrame(tool)
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.zeros(len(numbers)))
    placed = [np.array(data.oMi[row + 1].homogeneous) for row in range(len(numbers))]
    tool_to_base = np.array(data.oMf[frame].homogeneous)
    lower, upper = joints.lower[moving], joints.upper[moving]
    origins = np.array([placement[:3, 3] for placement in placed]).reshape(-1, 3)
    rotary = np.array([tree.joints[number].type is JointType.ROTARY for number in numbers], dtype=bool)
    strokes = np.abs(factors) @ np.maximum(np.abs(lower), np.abs(upper)) + np.abs(offsets)
    links = np.linalg.norm(np.diff([*origins, tool_to_base[:3, 3]], axis=0), axis=1)
    serial = np.array_equal(factors, np.eye(len(numbers)))
    weights = 1.0 / np.maximum(upper - lower, 1e-9) ** 2
    return Chain(
        joints=joints,
        moving=moving,
        lower=lower,
        upper=upper,
        home=joints.home[moving],
        limits=tuple(zip(lower.tolist(), upper.tolist(), weights.tolist(), strict=True)),
        rotary=bool(rotary.all()),
        serial=serial,
        axes=np.array(
            [p[:3, :3] @ tree.joints[n].axis for p, n in zip(placed, numbers, strict=True)]
        ).reshape(-1, 3),
        origins=origins,
        tool_to_base=tool_to_base,
        reach=float(links.sum() + strokes[~rotary].sum()),
        _model=model,
        _data=data,
        _frame=frame,
        _placement=data.oMf[frame],
        # Pinocchio holds it among the placements of links relative to others.
        _placement_with_jacobian=data.iMf[0],
        _base=pin.SE3(model.jointPlacements[1]) if numbers else None,
        _factors=None if serial else factors,
        _offsets=offsets,
    )


def aim(chain: Chain, target: Any) -> None:
    """Take a target, a pin.SE3, as the frame in which the chain's tool is placed.

    The deviation of the tool is then its placement: a product of matrices less in each step of a search.
    """
    if chain._base is not None:
        chain._model.jointPlacements[1] = target.actInv(chain._base)
    else:
        chain._model.frames[chain._frame].placement = target.actInv(pin.SE3(chain.tool_to_base))


def placement_misses(chain: Chain, x: FloatArray, target: Any, rows: int) -> tuple[float, float]:
    """Return the tool's deviation from a target at x: [m] and [rad].

    Args:
        target: A pin.SE3, tool to base.
        rows: See `misses`.
    """
    aim(chain, target)
    q = x if chain._factors is None else chain._factors @ x + chain._offsets
    pin.framesForwardKinematics(chain._model, chain._data, q)
    return misses(chain._placement.homogeneous.ravel().tolist(), rows)
