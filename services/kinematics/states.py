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
    RobotModel,
    all_placements,
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
            positions: (n,) joint positions [rad] or [m]; the last call's array gets its placements.
            fixtures: (4, 4) placements in the site's frame to include, by name.
        """
        if positions is not self._positions:
            placements = self._base_to_site @ all_placements(self._model, positions)[self._numbers]
            for row, placement in zip(self._rows, placements.tolist(), strict=True):
                _fill(row, placement)
            self._positions = positions
        for _, _, at in self._rows:
            at.seconds, at.nanos = timestamp.seconds, timestamp.nanos
        if not fixtures:
            return self._message
        message = FrameTransforms()
        message.CopyFrom(self._message)
        for name, fixture in fixtures.items():
            row = self._added(message, f"{self._site}/{name}")
            _fill(row, fixture.tolist())
            row[2].CopyFrom(timestamp)
        return message


# The parts of a FrameTransform that change: to look them up takes as long as to fill them.
_Row = tuple[Vector3, Quaternion, Timestamp]


def _fill(row: _Row, placement: Sequence[Sequence[float]]) -> None:
    to, turn, _ = row
    to.x, to.y, to.z = placement[0][3], placement[1][3], placement[2][3]
    turn.x, turn.y, turn.z, turn.w = quaternion(placement)


def quaternion(rotation: Sequence[Sequence[float]]) -> tuple[float, float, float, float]:
    """Convert a rotation matrix, or the upper left of a placement, to a unit quaternion x, y, z, w; w >= 0.

    Source: Shepperd 1978: from the largest of the four, so that half turns are exact, too.
    """
    (xx, xy, xz, *_), (yx, yy, yz, *_), (zx, zy, zz, *_), *_ = rotation
    # Four times each of the quaternion's products with its largest element.
    largest = max(xx, yy, zz, xx + yy + zz)
    if largest == xx:
        found = 1.0 + xx - yy - zz, yx + xy, xz + zx, zy - yz
    elif largest == yy:
        found = yx + xy, 1.0 - xx + yy - zz, zy + yz, xz - zx
    elif largest == zz:
        found = xz + zx, zy + yz, 1.0 - xx - yy + zz, yx - xy
    else:
        found = zy - yz, xz - zx, yx - xy, 1.0 + xx + yy + zz
    x, y, z, w = found
    length = math.copysign(math.hypot(x, y, z, w), w)
    return x / length, y / length, z / length, w / length


class StateMessage:
    """An arm's tool pose and twist in the base frame, manipulability, margins to singularities and limits.

    Args:
        reach: Result of `robots.kinematics.singularity.arm_length` [m].
    """

    def __init__(self, model: RobotModel, *, reach: float) -> None:
        self._model, self._reach = model, reach
        self._positions: FloatArray | None = None

    def filled(
        self, positions: FloatArray, velocities: FloatArray | None, timestamp: Timestamp
    ) -> schema.KinematicState:
        """Return a new message.

        Args:
            positions: (n,) [rad] or [m]; the last call's array gets its pose and margins.
            velocities: (n,) [rad/s] or [m/s]; None if unknown, then there is no twist.
        """
        if positions is not self._positions:
            self._jacobian = tool_jacobian(self._model, positions)
            self._placed = _placed_state(self._model, positions, self._jacobian, self._reach)
            self._positions = positions
        message = schema.KinematicState(timestamp=timestamp)
        message.MergeFrom(self._placed)
        if velocities is not None:
            twist = (self._jacobian @ velocities).tolist()
            _set(message.linear_velocity, twist[:3])
            _set(message.angular_velocity, twist[3:])
        return message


def _placed_state(
    model: RobotModel, positions: FloatArray, jacobian: FloatArray, reach: float
) -> schema.KinematicState:
    """Return what depends on an arm's positions alone."""
    joints = model.joints
    manipulable, margin = dexterity(jacobian, joints.types, reach=reach)
    message = schema.KinematicState(manipulability=manipulable, singularity_margin=margin)
    message.tool_to_base.extend(tool_placement(model, positions).ravel().tolist())
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
