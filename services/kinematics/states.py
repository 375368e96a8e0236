"""Joint states to the messages of `frames` and `kinematics`: pure functions."""

from collections.abc import Iterable

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.timestamp_pb2 import Timestamp

from bus.schemas import robomesh_pb2 as schema
from robots.joints import FloatArray, Joints, constraint_values
from robots.model import RobotModel, frame_placements, link_placements, manipulability, tool_jacobian


def positions_by_name(joints: Joints, states: JointStates) -> FloatArray | None:
    """(n,) joint positions [rad] or [m] in the robot's order; None: one is missing or not finite."""
    by_name = {joint.name: joint.position for joint in states.joints}
    positions = np.array([by_name.get(name, np.nan) for name in joints.names])
    return positions if np.isfinite(positions).all() else None


def velocities_by_name(joints: Joints, states: JointStates) -> FloatArray | None:
    """(n,) joint velocities [rad/s] or [m/s]; None: the controller does not tell them all."""
    by_name = {joint.name: joint.velocity for joint in states.joints if joint.HasField("velocity")}
    velocities = np.array([by_name.get(name, np.nan) for name in joints.names])
    return velocities if np.isfinite(velocities).all() else None


def frames_message(
    model: RobotModel,
    positions: FloatArray,
    *,
    prefix: str,
    base_to_site: FloatArray,
    timestamp: Timestamp,
) -> FrameTransforms:
    """Every link, the tool and every named frame, each placed in the site's frame.

    Args:
        positions: (n,) joint positions [rad] or [m].
        prefix: `<site>/<robot>`; the site's frame is its first part.
        base_to_site: (4, 4).
    """
    frames = frame_placements(model, positions)
    names = (*model.link_names, *frames)
    placements = base_to_site @ np.concatenate([link_placements(model, positions), [*frames.values()]])
    rotations = quaternions(placements[:, :3, :3])
    site = prefix.partition("/")[0]
    message = FrameTransforms()
    for name, placement, (x, y, z, w) in zip(names, placements, rotations.tolist(), strict=True):
        transform = message.transforms.add(parent_frame_id=site, child_frame_id=f"{prefix}/{name}")
        transform.timestamp.CopyFrom(timestamp)
        transform.translation.x, transform.translation.y, transform.translation.z = placement[:3, 3].tolist()
        transform.rotation.x, transform.rotation.y = x, y
        transform.rotation.z, transform.rotation.w = z, w
    return message


def quaternions(rotations: FloatArray) -> FloatArray:
    """Unit quaternions x, y, z, w of rotation matrices: (m, 3, 3) to (m, 4), w not negative.

    Source: Bar-Itzhack 2000: the eigenvector of the largest eigenvalue; exact at half turns too.
    """
    r = rotations
    k = np.empty((len(r), 4, 4))
    k[:, 0, 0] = r[:, 0, 0] - r[:, 1, 1] - r[:, 2, 2]
    k[:, 1, 1] = r[:, 1, 1] - r[:, 0, 0] - r[:, 2, 2]
    k[:, 2, 2] = r[:, 2, 2] - r[:, 0, 0] - r[:, 1, 1]
    k[:, 3, 3] = r[:, 0, 0] + r[:, 1, 1] + r[:, 2, 2]
    k[:, 1, 0] = k[:, 0, 1] = r[:, 1, 0] + r[:, 0, 1]
    k[:, 2, 0] = k[:, 0, 2] = r[:, 2, 0] + r[:, 0, 2]
    k[:, 2, 1] = k[:, 1, 2] = r[:, 2, 1] + r[:, 1, 2]
    k[:, 3, 0] = k[:, 0, 3] = r[:, 2, 1] - r[:, 1, 2]
    k[:, 3, 1] = k[:, 1, 3] = r[:, 0, 2] - r[:, 2, 0]
    k[:, 3, 2] = k[:, 2, 3] = r[:, 1, 0] - r[:, 0, 1]
    _, vectors = np.linalg.eigh(k)
    q: FloatArray = vectors[:, :, 3]
    return np.where(q[:, 3:] < 0, -q, q)


def kinematic_state(
    model: RobotModel, positions: FloatArray, velocities: FloatArray | None, *, timestamp: Timestamp
) -> schema.KinematicState:
    """Tool pose and twist in the base frame, manipulability, margins to every limit.

    Args:
        positions: (n,) [rad] or [m].
        velocities: (n,) [rad/s] or [m/s]; None: not known, and no twist is told.
    """
    message = schema.KinematicState(timestamp=timestamp, manipulability=manipulability(model, positions))
    message.tool_to_base.extend(frame_placements(model, positions)["tool"].ravel().tolist())
    if velocities is not None:
        twist = (tool_jacobian(model, positions) @ velocities).tolist()
        message.linear_velocity.CopyFrom(_vector(twist[:3]))
        message.angular_velocity.CopyFrom(_vector(twist[3:]))
    joints = model.joints
    for name, position, lower, upper in zip(
        joints.names, positions.tolist(), joints.lower.tolist(), joints.upper.tolist(), strict=True
    ):
        message.limit_margins.add(name=name, lower=position - lower, upper=upper - position)
    for constraint, total in zip(
        joints.constraints, constraint_values(joints, positions).tolist(), strict=True
    ):
        message.limit_margins.add(
            name="+".join(constraint.names), lower=total - constraint.lower, upper=constraint.upper - total
        )
    return message


def forward_answer(model: RobotModel, positions: FloatArray) -> schema.ForwardAnswer:
    """Tool, links and named frames in the base frame for joint positions (n,) [rad] or [m]."""
    frames = frame_placements(model, positions)
    answer = schema.ForwardAnswer(tool_to_base=frames["tool"].ravel().tolist())
    placed = [*zip(model.link_names, link_placements(model, positions), strict=True), *frames.items()]
    for name, placement in placed:
        answer.links.add(name=name, placement_to_base=placement.ravel().tolist())
    return answer


def _vector(values: Iterable[float]) -> schema.Vector3:
    x, y, z = values
    return schema.Vector3(x=x, y=y, z=z)
