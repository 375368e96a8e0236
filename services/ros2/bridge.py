"""Conversion of the mesh's joints, frames and descriptions to the standard topics of ROS 2 tools."""

import asyncio
import logging
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from robomesh.contract.keys import Key, every_robot
from robomesh.contract.topics import Priority
from robomesh.errors import RobomeshError
from robomesh.publications.subscription import Sample
from robomesh.schemas.robomesh_pb2 import Description
from robomesh.wire.session import Session
from robots.descriptions.urdf.viewers import WORLD, Viewed, together
from services.ros2.settings import Settings
from services.ros2.shapes import ShapeFiles
from services.ros2.wire import Node, Topic, message
from services.viewers.robots import viewer_robot

log = logging.getLogger(__name__)

JOINT_STATES = Topic(name="joint_states", kind="sensor_msgs/msg/JointState", priority=Priority.REAL_TIME)
# The same quality of service as tf2's broadcasters.
TF = Topic(name="tf", kind="tf2_msgs/msg/TFMessage", depth=100, priority=Priority.INTERACTIVE_HIGH)
TF_STATIC = Topic(name="tf_static", kind="tf2_msgs/msg/TFMessage", depth=1, latched=True)
ROBOT_DESCRIPTION = Topic(name="robot_description", kind="std_msgs/msg/String", depth=1, latched=True)

_NS = 1_000_000_000
# Size of the queues: a tenth of a second of 100 robots' states.
_NEWEST = 1000


class Bridge:
    """Publisher of the mesh's robots as one ROS 2 node."""

    def __init__(self, session: Session, settings: Settings) -> None:
        self._session, self._settings = session, settings
        self._node = Node(session.zenoh_session, settings.node, domain=settings.domain)
        self._joint_states = self._node.publish(JOINT_STATES)
        self._tf = self._node.publish(TF)
        self._tf_static = self._node.publish(TF_STATIC)
        self._description = self._node.publish(ROBOT_DESCRIPTION)
        self._shapes = ShapeFiles(session, settings.shapes)
        self._described: dict[tuple[str, str], Viewed] = {}
        self._published_text = ""
        self._invalid_keys: set[str] = set()
        # Joint names have no prefix if the settings name exactly one robot.
        self._plain = len(settings.robots) == 1

    async def run(self) -> None:
        """Forward messages until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._follow("joints", self._joints))
            group.create_task(self._follow("frames", self._frames))
            group.create_task(self._follow_descriptions())

    def close(self) -> None:
        """Remove the node from the ROS graph."""
        self._node.close()

    async def _follow(self, topic: str, forward: Callable[[Sample, Key], None]) -> None:
        # Without history: a last value, published with a new number, would look live to ROS.
        subscription = self._session.subscribe(every_robot(topic), newest=_NEWEST, history=False)
        async for sample in subscription:
            key = sample.parsed
            if not self._settings.wants(key.site, key.robot):
                continue
            try:
                forward(sample, key)
            except Exception as error:  # an invalid message must not end the forwarding of others
                level = logging.DEBUG if sample.key in self._invalid_keys else logging.WARNING
                self._invalid_keys.add(sample.key)
                log.log(level, "%s: a message cannot be converted for ROS 2: %s", sample.key, error)

    def _joints(self, sample: Sample, key: Key) -> None:
        if not self._joint_states.watched:
            return
        states = sample.message()
        assert isinstance(states, JointStates)
        prefix = "" if self._plain else f"{key.site}/{key.robot}/"
        joints = states.joints
        converted = message(
            JOINT_STATES.kind,
            header=_header(states.timestamp.ToNanoseconds(), ""),
            name=[prefix + joint.name for joint in joints],
            position=np.array([joint.position for joint in joints]),
            # All values or none: ROS 2 matches them with the names by index.
            velocity=_all([joint.velocity if joint.HasField("velocity") else None for joint in joints]),
            effort=_all([joint.effort if joint.HasField("effort") else None for joint in joints]),
        )
        self._joint_states.put(converted, source_time_ns=sample.header.source_time_ns)

    def _frames(self, sample: Sample, key: Key) -> None:
        if not self._tf.watched:
            return
        frames = sample.message()
        assert isinstance(frames, FrameTransforms)
        converted = message(TF.kind, transforms=[_transform(each) for each in frames.transforms])
        self._tf.put(converted, source_time_ns=sample.header.source_time_ns)

    async def _follow_descriptions(self) -> None:
        async for sample in self._session.subscribe(every_robot("description"), newest=1000):
            site, robot, _ = sample.parsed
            if not self._settings.wants(site, robot):
                continue
            try:
                description = sample.message()
            except RobomeshError as error:
                log.debug("%s: %s", sample.key, error)
                continue
            assert isinstance(description, Description)
            if description.urdf:
                uris = await self._shapes.of(site, robot, description)
                self._described[site, robot] = viewer_robot(site, robot, description, uris.get)
                self._publish_description()

    def _publish_description(self) -> None:
        """Publish all robots in one description, and the transforms between the sites' frames."""
        robots = sorted(self._described.values(), key=lambda each: (each.site, each.robot))
        text = together(robots, joints="plain" if self._plain else "prefixed")
        if text == self._published_text:
            return
        self._published_text = text
        now_ns = time.time_ns()
        self._description.put(message(ROBOT_DESCRIPTION.kind, data=text), source_time_ns=now_ns)
        sites = sorted({each.site for each in robots})
        if len(sites) > 1:
            static = FrameTransforms()
            for site in sites:
                transform = static.transforms.add(parent_frame_id=WORLD, child_frame_id=site)
                transform.rotation.w = 1.0
            transforms = [_transform(each) for each in static.transforms]
            self._tf_static.put(message(TF_STATIC.kind, transforms=transforms), source_time_ns=now_ns)


def _all(values: list[float | None]) -> Any:
    return np.array([] if None in values else values, dtype=np.float64)


def _header(time_ns: int, frame: str) -> Any:
    seconds, nanoseconds = divmod(time_ns, _NS)
    stamp = message("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    return message("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def _transform(frame: Any) -> Any:
    translation, rotation = frame.translation, frame.rotation
    return message(
        "geometry_msgs/msg/TransformStamped",
        header=_header(frame.timestamp.ToNanoseconds(), frame.parent_frame_id),
        child_frame_id=frame.child_frame_id,
        transform=message(
            "geometry_msgs/msg/Transform",
            translation=message(
                "geometry_msgs/msg/Vector3", x=translation.x, y=translation.y, z=translation.z
            ),
            rotation=message(
                "geometry_msgs/msg/Quaternion", x=rotation.x, y=rotation.y, z=rotation.z, w=rotation.w
            ),
        ),
    )
