"""Conversion of joint states to `frames` and `kinematics` messages: pure functions."""

from collections.abc import Iterable, Mapping

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.timestamp_pb2 import Timestamp

from robomesh.schemas import robomesh_pb2 as schema
from robots.joints import FloatArray, Joints, constraint_values
from robots.model import RobotModel, frame_placements, link_placements, manipulability, tool_jacobian
from robots.singularity import singularity_margin
from services.kinematics.cell_state import Proximity


def positions_by_name(joints: Joints, states: JointStates) -> FloatArray | None:
    """Return (n,) joint positions [rad] or [m] in the robot's order; None if one is missing or not finite."""
    by_name = {joint.name: joint.position for joint in states.joints}
    positions = np.array([by_name.get(name, np.nan) for name in joints.names])
    return positions if np.isfinite(positions).all() else None


def velocities_by_name(joints: Joints, states: JointStates) -> FloatArray | None:
    """Return (n,) joint velocities [rad/s] or [m/s]; None if the controller does not report all of them."""
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
    fixtures: Mapping[str, FloatArray] | None = None,
) -> FrameTransforms:
    """Return the placements of every link, the tool and every named frame in the site's frame.

    Args:
        positions: (n,) joint positions [rad] or [m].
        prefix: `<site>/<robot>`; the site's frame has the name of the site.
        base_to_site: (4, 4) placement of the base in the site's frame.
        fixtures: (4, 4) placements in the site's frame to include, by name.
    """
    frames = dict(zip(model.link_names, link_placements(model, positions), strict=True))
    # A URDF's link named "tool" shares the tool's frame.
    frames |= frame_placements(model, positions)
    placements = base_to_site @ np.array([*frames.values()])
    site = prefix.partition("/")[0]
    ids = [f"{prefix}/{name}" for name in frames]
    if fixtures:
        placements = np.concatenate([placements, [*fixtures.values()]])
        ids += [f"{site}/{name}" for name in fixtures]
    rotations = quaternions(placements[:, :3, :3])
    message = FrameTransforms()
    for frame_id, placement, (x, y, z, w) in zip(ids, placements, rotations.tolist(), strict=True):
        transform = message.transforms.add(parent_frame_id=site, child_frame_id=frame_id)
        transform.timestamp.CopyFrom(timestamp)
        transform.translation.x, transform.translation.y, transform.translation.z = placement[:3, 3].tolist()
        transform.rotation.x, transform.rotation.y = x, y
        transform.rotation.z, transform.rotation.w = z, w
    return message


def quaternions(rotations: FloatArray) -> FloatArray:
    """Convert rotation matrices (m, 3, 3) to unit quaternions x, y, z, w (m, 4), w not negative.

    Source: Bar-Itzhack 2000: the eigenvector of the largest eigenvalue; also exact at half turns.
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
    model: RobotModel,
    positions: FloatArray,
    velocities: FloatArray | None,
    *,
    reach: float,
    timestamp: Timestamp,
) -> schema.KinematicState:
    """Return tool pose and twist in the base frame, manipulability, and margins to singularities and limits.

    Args:
        positions: (n,) [rad] or [m].
        velocities: (n,) [rad/s] or [m/s]; None if unknown, then there is no twist.
        reach: Result of `robots.singularity.reach_of` [m].
    """
    message = schema.KinematicState(
        timestamp=timestamp,
        manipulability=manipulability(model, positions),
        singularity_margin=singularity_margin(model, positions, reach=reach),
    )
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


def add_proximity(message: schema.KinematicState, proximity: Proximity, *, site: str) -> None:
    """Add an arm's clearances; the frame ids of the pairs begin with the site."""
    for field, nearest in ((message.clearance, proximity.outside), (message.own_clearance, proximity.own)):
        if nearest is not None:
            field.distance = nearest.distance_m
            field.first, field.second = (f"{site}/{name}" for name in nearest.pair)
            field.first_point.CopyFrom(_vector(nearest.points[0].tolist()))
            field.second_point.CopyFrom(_vector(nearest.points[1].tolist()))
    message.not_counted.extend(proximity.not_counted)


def forward_answer(model: RobotModel, positions: FloatArray) -> schema.ForwardAnswer:
    """Return tool, links and named frames in the base frame for joint positions (n,) [rad] or [m]."""
    placed = dict(zip(model.link_names, link_placements(model, positions), strict=True))
    placed |= frame_placements(model, positions)
    answer = schema.ForwardAnswer(tool_to_base=placed["tool"].ravel().tolist())
    for name, placement in placed.items():
        answer.links.add(name=name, placement_to_base=placement.ravel().tolist())
    return answer


def _vector(values: Iterable[float]) -> schema.Vector3:
    x, y, z = values
    return schema.Vector3(x=x, y=y, z=z)
