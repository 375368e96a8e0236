"""Conversion of joint states to `frames` and `kinematics` messages: pure functions."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp

from robomesh.schemas import robomesh_pb2 as schema
from robots.kinematics.joints import FloatArray, Joints, constraint_values
from robots.kinematics.model import (
    Pose,
    RobotModel,
    all_placements,
    all_poses,
    placement_pose,
    tool_jacobian,
    tool_placement,
)
from robots.kinematics.singularity import dexterity
from services.kinematics.cell_state import Proximity


def positions_by_name(joints: Joints, states: JointStates) -> FloatArray | None:
    """Return (n,) joint positions [rad] or [m] in the robot's order; None if one is missing or not finite."""
    return _in_order(joints, {joint.name: joint.position for joint in states.joints})


def velocities_by_name(joints: Joints, states: JointStates) -> FloatArray | None:
    """Return (n,) joint velocities [rad/s] or [m/s]; None if the controller does not report all of them."""
    reported = {joint.name: joint.velocity for joint in states.joints if joint.HasField("velocity")}
    return _in_order(joints, reported)


def _in_order(joints: Joints, values: Mapping[str, float]) -> FloatArray | None:
    ordered = [values.get(name, math.nan) for name in joints.names]
    return np.array(ordered) if all(map(math.isfinite, ordered)) else None


class FramesMessage:
    """The placements of an arm's links, tool and named frames as a message, which is filled again and again.

    Args:
        prefix: `<site>/<robot>`; the site's frame has the name of the site.
        base_to_site: (4, 4) placement of the base in the site's frame.
    """

    def __init__(self, model: RobotModel, *, prefix: str, base_to_site: FloatArray) -> None:
        self._model, self._base_to_site = model, base_to_site
        self._site = prefix.partition("/")[0]
        # A URDF's link named "tool" shares the tool's frame, which comes later.
        numbers = {name: number for number, name in enumerate((*model.link_names, *model.frame_names))}
        self._numbers = [*numbers.values()]
        self._message = FrameTransforms()
        self._rows = [self._added(self._message, f"{prefix}/{name}") for name in numbers]
        self._positions: FloatArray | None = None

    def _added(self, message: FrameTransforms, frame_id: str) -> "_Row":
        row = message.transforms.add(parent_frame_id=self._site, child_frame_id=frame_id)
        return row.translation, row.rotation, row.timestamp

    def filled(
        self,
        positions: FloatArray,
        timestamp: Timestamp,
        fixtures: Mapping[str, FloatArray] | None = None,
    ) -> FrameTransforms:
        """Return the placements in the site's frame; the next call changes a message without fixtures.

        Args:
            positions: (n,) joint positions [rad] or [m]; the array of the last call is not computed again.
            fixtures: (4, 4) placements in the site's frame to include, by name.
        """
        if positions is not self._positions:
            poses = all_poses(self._model, positions, self._base_to_site)
            for row, number in zip(self._rows, self._numbers, strict=True):
                _fill(row, poses[number])
            self._positions = positions
        for _, _, at in self._rows:
            at.seconds, at.nanos = timestamp.seconds, timestamp.nanos
        if not fixtures:
            return self._message
        message = FrameTransforms()
        message.CopyFrom(self._message)
        for name, fixture in fixtures.items():
            row = self._added(message, f"{self._site}/{name}")
            _fill(row, placement_pose(fixture))
            row[2].CopyFrom(timestamp)
        return message


# The parts of a FrameTransform that change: to look them up takes as long as to fill them.
_Row = tuple[Vector3, Quaternion, Timestamp]


def _fill(row: _Row, pose: Pose) -> None:
    to, turn, _ = row
    to.x, to.y, to.z, turn.x, turn.y, turn.z, turn.w = pose


class StateMessage:
    """An arm's tool pose and twist in the base frame, manipulability, margins to singularities and limits.

    Args:
        reach: Result of `robots.kinematics.singularity.arm_length` [m].
    """

    def __init__(self, model: RobotModel, *, reach: float) -> None:
        self._model, self._reach = model, reach
        joints = model.joints
        names = (*joints.names, *("+".join(each.names) for each in joints.constraints))
        self._lower = np.array([*joints.lower, *(each.lower for each in joints.constraints)])
        self._upper = np.array([*joints.upper, *(each.upper for each in joints.constraints)])
        self._message = schema.KinematicState(limit_margins=[{"name": name} for name in names])
        self._margins = [*self._message.limit_margins]
        self._positions: FloatArray | None = None

    def filled(
        self, positions: FloatArray, velocities: FloatArray | None, timestamp: Timestamp
    ) -> schema.KinematicState:
        """Return the message without a clearance; the next call changes it.

        Args:
            positions: (n,) [rad] or [m]; the array of the last call is not computed again.
            velocities: (n,) [rad/s] or [m/s]; None if unknown, then there is no twist.
        """
        message = self._message
        message.timestamp.CopyFrom(timestamp)
        if positions is not self._positions:
            self._place(positions)
            self._positions = positions
        if velocities is None:
            message.ClearField("linear_velocity")
            message.ClearField("angular_velocity")
        else:
            twist = (self._jacobian @ velocities).tolist()
            _set(message.linear_velocity, twist[:3])
            _set(message.angular_velocity, twist[3:])
        for name in ("clearance", "own_clearance", "not_counted"):
            message.ClearField(name)
        return message

    def _place(self, positions: FloatArray) -> None:
        """Fill in what depends on the positions alone."""
        message, joints = self._message, self._model.joints
        self._jacobian = tool_jacobian(self._model, positions)
        message.manipulability, message.singularity_margin = dexterity(
            self._jacobian, joints.types, reach=self._reach
        )
        message.tool_to_base[:] = tool_placement(self._model, positions).ravel().tolist()
        values = positions
        if joints.constraints:
            values = np.concatenate([positions, constraint_values(joints, positions)])
        above, below = (values - self._lower).tolist(), (self._upper - values).tolist()
        for margin, lower, upper in zip(self._margins, above, below, strict=True):
            margin.lower, margin.upper = lower, upper


def add_proximity(message: schema.KinematicState, proximity: Proximity, *, site: str) -> None:
    """Add an arm's clearances; the frame ids of the pairs begin with the site."""
    for field, nearest in ((message.clearance, proximity.outside), (message.own_clearance, proximity.own)):
        if nearest is not None:
            field.distance = nearest.distance_m
            field.first, field.second = (f"{site}/{name}" for name in nearest.pair)
            _set(field.first_point, nearest.points[0].tolist())
            _set(field.second_point, nearest.points[1].tolist())
    message.not_counted.extend(proximity.not_counted)


def forward_answer(model: RobotModel, positions: FloatArray) -> schema.ForwardAnswer:
    """Return tool, links and named frames in the base frame for joint positions (n,) [rad] or [m]."""
    names = (*model.link_names, *model.frame_names)
    placed = dict(zip(names, all_placements(model, positions), strict=True))
    answer = schema.ForwardAnswer(tool_to_base=placed["tool"].ravel().tolist())
    for name, placement in placed.items():
        answer.links.add(name=name, placement_to_base=placement.ravel().tolist())
    return answer


def _set(vector: schema.Vector3, values: Sequence[float]) -> None:
    vector.SetInParent()  # also if all values are 0
    vector.x, vector.y, vector.z = values
