"""The mesh's joints, frames and descriptions as the three topics that every ROS 2 tool looks for."""

import asyncio
import logging
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from robomesh.errors import BusError
from robomesh.keys import Key, every_robot
from robomesh.schemas.robomesh_pb2 import Description
from robomesh.session import Session
from robomesh.subscription import Sample
from robomesh.topics import Priority
from robots.urdf.viewers import WORLD, Viewed, together
from services.ros2.meshes import Meshes
from services.ros2.settings import Settings
from services.ros2.wire import Node, Topic, message
from services.viewer_robots import viewed

log = logging.getLogger(__name__)

JOINT_STATES = Topic(name="joint_states", kind="sensor_msgs/msg/JointState", priority=Priority.REAL_TIME)
# As tf2's own broadcasters have them.
TF = Topic(name="tf", kind="tf2_msgs/msg/TFMessage", depth=100, priority=Priority.INTERACTIVE_HIGH)
TF_STATIC = Topic(name="tf_static", kind="tf2_msgs/msg/TFMessage", depth=1, latched=True)
ROBOT_DESCRIPTION = Topic(name="robot_description", kind="std_msgs/msg/String", depth=1, latched=True)

_NS = 1_000_000_000
# So many states wait while one is passed on: of 100 robots a tenth of a second.
_NEWEST = 1000


class Bridge:
    """What of the mesh ROS 2 sees."""

    def __init__(self, session: Session, settings: Settings) -> None:
        self._session, self._settings = session, settings
        self._node = Node(session.zenoh_session, settings.node, domain=settings.domain)
        self._joint_states = self._node.publish(JOINT_STATES)
        self._tf = self._node.publish(TF)
        self._tf_static = self._node.publish(TF_STATIC)
        self._description = self._node.publish(ROBOT_DESCRIPTION)
        self._meshes = Meshes(session, settings.meshes)
        self._described: dict[tuple[str, str], Viewed] = {}
        self._told = ""
        self._nonsense: set[str] = set()
        # Joint names stand alone where there is one robot, which was named.
        self._plain = len(settings.robots) == 1

    async def run(self) -> None:
        """Pass on what comes until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._follow("joints", self._joints))
            group.create_task(self._follow("frames", self._frames))
            group.create_task(self._follow_descriptions())

    def close(self) -> None:
        """ROS 2 sees nothing of it any more."""
        self._node.close()

    async def _follow(self, topic: str, pass_on: Callable[[Sample, Key], None]) -> None:
        # Only what is live: an old state with a new number would look live to ROS.
        subscription = self._session.subscribe(every_robot(topic), newest=_NEWEST, history=False)
        async for sample in subscription:
            place = sample.parsed
            if not self._settings.wants(place.site, place.robot):
                continue
            try:
                pass_on(sample, place)
            except Exception as error:  # one publisher's nonsense must not end what all others say
                level = logging.DEBUG if sample.key in self._nonsense else logging.WARNING
                self._nonsense.add(sample.key)
                log.log(level, "%s: a message cannot be told to ROS 2: %s", sample.key, error)

    def _joints(self, sample: Sample, place: Key) -> None:
        if not self._joint_states.watched:
            return
        states = sample.message()
        assert isinstance(states, JointStates)
        prefix = "" if self._plain else f"{place.site}/{place.robot}/"
        joints = states.joints
        told = message(
            JOINT_STATES.kind,
            header=_header(states.timestamp.ToNanoseconds(), ""),
            name=[prefix + joint.name for joint in joints],
            position=np.array([joint.position for joint in joints]),
            # All of them, or none: ROS 2 takes them by their place.
            velocity=_all([joint.velocity if joint.HasField("velocity") else None for joint in joints]),
            effort=_all([joint.effort if joint.HasField("effort") else None for joint in joints]),
        )
        self._joint_states.put(told, source_time_ns=sample.header.source_time_ns)

    def _frames(self, sample: Sample, place: Key) -> None:
        if not self._tf.watched:
            return
        frames = sample.message()
        assert isinstance(frames, FrameTransforms)
        told = message(TF.kind, transforms=[_transform(each) for each in frames.transforms])
        self._tf.put(told, source_time_ns=sample.header.source_time_ns)

    async def _follow_descriptions(self) -> None:
        async for sample in self._session.subscribe(every_robot("description"), newest=1000):
            site, robot, _ = sample.parsed
            if not self._settings.wants(site, robot):
                continue
            try:
                description = sample.message()
            except BusError as error:
                log.debug("%s: %s", sample.key, error)
                continue
            assert isinstance(description, Description)
            if description.urdf:
                uris = await self._meshes.of(site, robot, description)
                self._described[site, robot] = viewed(site, robot, description, uris.get)
                self._tell()

    def _tell(self) -> None:
        """All robots in one description, and how the sites' frames hang together."""
        robots = sorted(self._described.values(), key=lambda each: (each.site, each.robot))
        text = together(robots, plain_joints=self._plain)
        if text == self._told:
            return
        self._told = text
        now_ns = time.time_ns()
        self._description.put(message(ROBOT_DESCRIPTION.kind, data=text), source_time_ns=now_ns)
        sites = sorted({each.site for each in robots})
        if len(sites) > 1:
            still = FrameTransforms()
            for site in sites:
                transform = still.transforms.add(parent_frame_id=WORLD, child_frame_id=site)
                transform.rotation.w = 1.0
            transforms = [_transform(each) for each in still.transforms]
            self._tf_static.put(message(TF_STATIC.kind, transforms=transforms), source_time_ns=now_ns)


def _all(values: list[float | None]) -> Any:
    return np.array([] if None in values else values, dtype=np.float64)


def _header(time_ns: int, frame: str) -> Any:
    seconds, nanoseconds = divmod(time_ns, _NS)
    stamp = message("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    return message("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def _transform(frame: Any) -> Any:
    at, turned = frame.translation, frame.rotation
    return message(
        "geometry_msgs/msg/TransformStamped",
        header=_header(frame.timestamp.ToNanoseconds(), frame.parent_frame_id),
        child_frame_id=frame.child_frame_id,
        transform=message(
            "geometry_msgs/msg/Transform",
            translation=message("geometry_msgs/msg/Vector3", x=at.x, y=at.y, z=at.z),
            rotation=message("geometry_msgs/msg/Quaternion", x=turned.x, y=turned.y, z=turned.z, w=turned.w),
        ),
    )
