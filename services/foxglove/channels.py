"""Which channels there are: those of each robot, of each site, and one description of all robots."""

import logging
import time
from functools import partial

import foxglove
from foxglove_schemas_protobuf.Log_pb2 import Log

from robomesh.keys import WHOLE_SITE, is_replay, robot_key
from robomesh.schemas.robomesh_pb2 import Description
from robomesh.session import Session
from robomesh.topics import topic
from robots.urdf.viewers import together
from services.foxglove.channel_subscriptions import Lane, Told
from services.foxglove.messages import TEXT_SCHEMA, log_of, protobuf_schema, text_message
from services.viewer_robots import meshes_of, viewed

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
    "description",
)
_OF_A_REPLAY = ("joints", "frames", "kinematics", "controller", "lease", "program", "replay", "description")
_OF_A_SITE = ("mesh", "alarms")
# What the renderer draws beside the views that a description names.
_VIEWS = ("free", "close")
# Recordings have it under this name too: a layout made for them fits.
_DESCRIPTION = "/robot_description"
_ASSETS = "package://robomesh/"


class Channels:
    """The channels of what is on the mesh.

    Attributes:
        lanes: By channel's topic.
    """

    def __init__(self, session: Session, context: foxglove.Context, *, one_robot: bool) -> None:
        self.lanes: dict[str, Lane | Told] = {}
        self._session, self._context = session, context
        self._one_robot = one_robot
        # A robot that comes again may be what it was, and then nobody tells it again.
        self._described: dict[tuple[str, str], Description] = {}
        self._there: set[tuple[str, str]] = set()
        channel = self._channel(_DESCRIPTION, "cdr", TEXT_SCHEMA)
        self._whole = self.lanes[_DESCRIPTION] = Told(channel)

    def add(self, site: str, robot: str) -> None:
        """A robot, or a site (`-`), is there.

        Raises:
            KeyNameError: If its name can be in no key.
        """
        if (site, robot) in self._there:
            return
        for name in _topics_of(robot):
            self._add(site, robot, name)
        key = robot_key(site, robot, "log")
        events = tuple(robot_key(site, robot, name) for name in ("events", "events/*"))
        channel = self._channel(key, "protobuf", protobuf_schema(Log))
        place = site if robot == WHOLE_SITE else f"{site}/{robot}"
        self.lanes[key] = Lane(self._session, channel, events, partial(log_of, robot=place))
        self._there.add((site, robot))
        if (known := self._described.get((site, robot))) is not None:
            self.describe(site, robot, known)

    def describe(self, site: str, robot: str, description: Description) -> None:
        """What a robot is that is there: its views as video, and its place in the description of all.

        Raises:
            BusError: If a view of it has a name that can be in no key.
        """
        views = dict.fromkeys((*(view.name for view in description.views), *_VIEWS))
        for view in views:
            self._add(site, robot, f"video/{view}")
            if description.HasField("replay"):
                self._add(site, robot, f"video/recorded-{view}")
        self._described[site, robot] = description
        self._tell()

    def drop(self, site: str, robot: str) -> None:
        """A robot, or a site, is there no more."""
        prefix = robot_key(site, robot, "")
        for key in [key for key in self.lanes if key.startswith(prefix)]:
            self.lanes.pop(key).close()
        self._there.discard((site, robot))
        self._tell()

    def watches(self, client: int, site: str, robot: str) -> bool:
        """Whether a client watches anything of a robot."""
        prefix = robot_key(site, robot, "")
        return any(client in lane.watchers for key, lane in self.lanes.items() if key.startswith(prefix))

    @property
    def watched(self) -> int:
        """How many channels somebody watches."""
        return sum(bool(lane.watchers) for lane in self.lanes.values())

    def asset_key(self, uri: str) -> str | None:
        """What to ask the mesh for a file that a description names; None: it names no such file."""
        parts = uri.removeprefix(_ASSETS).removesuffix(".glb").split("/")
        if not uri.startswith(_ASSETS) or len(parts) != 3:
            return None
        site, robot, mesh = parts
        description = self._described.get((site, robot))
        if description is None or mesh not in meshes_of(description):
            return None
        return robot_key(site, robot, f"mesh/{mesh}")

    def close(self) -> None:
        """None of them is there any more."""
        for lane in self.lanes.values():
            lane.close()
        self.lanes.clear()

    def _add(self, site: str, robot: str, name: str) -> None:
        key = robot_key(site, robot, name)
        if key not in self.lanes:
            channel = self._channel(key, "protobuf", protobuf_schema(topic(name).schema))
            self.lanes[key] = Lane(self._session, channel, (key,))

    def _channel(self, name: str, encoding: str, schema: foxglove.Schema) -> foxglove.Channel:
        return foxglove.Channel(name, message_encoding=encoding, schema=schema, context=self._context)

    def _tell(self) -> None:
        robots = [
            viewed(site, robot, told, f"{_ASSETS}{site}/{robot}/{{}}.glb".format)
            for (site, robot), told in sorted(self._described.items())
            if told.urdf and (site, robot) in self._there
        ]
        text = together(robots, plain_joints=self._one_robot)
        self._whole.tell(text_message(text), time.time_ns())


def _topics_of(robot: str) -> tuple[str, ...]:
    if robot == WHOLE_SITE:
        return _OF_A_SITE
    return _OF_A_REPLAY if is_replay(robot) else _OF_A_ROBOT
