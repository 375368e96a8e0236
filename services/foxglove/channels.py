"""Set of channels: those of each robot and of each site, and one description of all robots."""

import logging
import time
from functools import partial

import foxglove
from foxglove_schemas_protobuf.Log_pb2 import Log

from robomesh.contract.keys import WHOLE_SITE, is_replay, robot_key
from robomesh.contract.topics import topic
from robomesh.schemas.robomesh_pb2 import Description
from robomesh.wire.session import Session
from robots.descriptions.urdf.viewers import together
from services.foxglove.channel_subscriptions import LatchedChannel, TopicChannel
from services.foxglove.messages import TEXT_SCHEMA, log_of, protobuf_schema, text_message
from services.viewers.robots import shapes_of, viewer_robot

log = logging.getLogger(__name__)

_OF_A_ROBOT = (
    "joints",
    "joints/slow",
    "frames",
    "kinematics",
    "controller",
    "lease",
    "program",
    "recording",
    "audit",
    "raw",
    "signals",
    "description",
)
_OF_A_REPLAY = (
    "joints",
    "frames",
    "kinematics",
    "controller",
    "lease",
    "program",
    "signals",
    "replay",
    "description",
)
_OF_A_SITE = ("mesh", "alarms")
# Views that the renderer offers in addition to those of a description.
_VIEWS = ("free", "close")
# The same name as in recordings, so that a layout fits both.
_DESCRIPTION = "/robot_description"
_ASSETS = "package://robomesh/"


class Channels:
    """The channels of the robots and sites on the mesh.

    Attributes:
        topic_channels: The channels by topic.
    """

    def __init__(self, session: Session, context: foxglove.Context) -> None:
        self.topic_channels: dict[str, TopicChannel | LatchedChannel] = {}
        self._session, self._context = session, context
        # Kept when a robot goes offline: its description is not published again when it returns.
        self._described: dict[tuple[str, str], Description] = {}
        self._present: set[tuple[str, str]] = set()
        channel = self._channel(_DESCRIPTION, "cdr", TEXT_SCHEMA)
        self._all_robots = self.topic_channels[_DESCRIPTION] = LatchedChannel(channel)

    def add(self, site: str, robot: str) -> None:
        """Add the channels of a robot, or of a site (`-`).

        Raises:
            KeyNameError: If its name is invalid in a key.
        """
        if (site, robot) in self._present:
            return
        for name in _topics_of(robot):
            self._add(site, robot, name)
        key = robot_key(site, robot, "log")
        events = tuple(robot_key(site, robot, name) for name in ("events", "events/*"))
        channel = self._channel(key, "protobuf", protobuf_schema(Log))
        name = site if robot == WHOLE_SITE else f"{site}/{robot}"
        self.topic_channels[key] = TopicChannel(self._session, channel, events, partial(log_of, robot=name))
        self._present.add((site, robot))
        if (known := self._described.get((site, robot))) is not None:
            self.describe(site, robot, known)

    def describe(self, site: str, robot: str, description: Description) -> None:
        """Add the video channels of a robot's views, and the robot to the common description.

        Raises:
            RobomeshError: If a view's name is invalid in a key.
        """
        views = dict.fromkeys((*(view.name for view in description.views), *_VIEWS))
        for view in views:
            self._add(site, robot, f"video/{view}")
            if description.HasField("replay"):
                self._add(site, robot, f"video/recorded-{view}")
        self._described[site, robot] = description
        self._publish_description()

    def drop(self, site: str, robot: str) -> None:
        """Remove the channels of a robot or a site."""
        prefix = robot_key(site, robot, "")
        for key in [key for key in self.topic_channels if key.startswith(prefix)]:
            self.topic_channels.pop(key).close()
        self._present.discard((site, robot))
        self._publish_description()

    def watches(self, client: int, site: str, robot: str) -> bool:
        """Return whether a client is subscribed to a channel of a robot."""
        prefix = robot_key(site, robot, "")
        return any(
            client in channel.watchers
            for key, channel in self.topic_channels.items()
            if key.startswith(prefix)
        )

    @property
    def watched(self) -> int:
        """Number of channels with at least one client."""
        return sum(bool(channel.watchers) for channel in self.topic_channels.values())

    def asset_key(self, uri: str) -> str | None:
        """Return the key of a file that a description names, or None for any other URI."""
        parts = uri.removeprefix(_ASSETS).removesuffix(".glb").split("/")
        if not uri.startswith(_ASSETS) or len(parts) != 3:
            return None
        site, robot, shape = parts
        description = self._described.get((site, robot))
        if description is None or shape not in shapes_of(description):
            return None
        return robot_key(site, robot, f"mesh/{shape}")

    def close(self) -> None:
        """Remove all channels."""
        for channel in self.topic_channels.values():
            channel.close()
        self.topic_channels.clear()

    def _add(self, site: str, robot: str, name: str) -> None:
        key = robot_key(site, robot, name)
        if key not in self.topic_channels:
            channel = self._channel(key, "protobuf", protobuf_schema(topic(name).schema))
            self.topic_channels[key] = TopicChannel(self._session, channel, (key,))

    def _channel(self, name: str, encoding: str, schema: foxglove.Schema) -> foxglove.Channel:
        return foxglove.Channel(name, message_encoding=encoding, schema=schema, context=self._context)

    def _publish_description(self) -> None:
        robots = [
            viewer_robot(site, robot, description, f"{_ASSETS}{site}/{robot}/{{}}.glb".format)
            for (site, robot), description in sorted(self._described.items())
            if description.urdf and (site, robot) in self._present
        ]
        text = together(robots, joints="none")
        self._all_robots.publish(text_message(text), time.time_ns())


def _topics_of(robot: str) -> tuple[str, ...]:
    if robot == WHOLE_SITE:
        return _OF_A_SITE
    return _OF_A_REPLAY if is_replay(robot) else _OF_A_ROBOT
