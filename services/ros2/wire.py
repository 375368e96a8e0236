"""rmw_zenoh's wire form: keys, attachments and liveliness tokens of ROS 2 topics.

<domain>/<topic>/<package>::msg::dds_::<Type>_/<type hash>                       data: CDR with its header
@ros2_lv/<domain>/<session>/<node>/<node>/NN/%/%/<name>                          a node
@ros2_lv/<domain>/<session>/<node>/<entity>/MP/%/%/<name>/%<topic>/<type>/<hash>/<qos>   a publisher
<data key>/@adv/pub/<session>/<entity>/...                                       what a late joiner asks

Attachment: sequence (int64), source time (int64, ns), 16 bytes that tell the publisher (their length first).
Source: the design document and the sources of ros2/rmw_zenoh (Jazzy).
"""

import re
import secrets
import struct
from dataclasses import dataclass
from typing import Any

import zenoh
import zenoh.ext
from rosbags.typesys import Stores, get_typestore

from robomesh.topics import Priority
from services.errors import ServiceError

_STORE = get_typestore(Stores.ROS2_JAZZY)
_ATTACHMENT = struct.Struct("<qqB16s")
_TOKENS = "@ros2_lv"
_NODE = 0
_NODE_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
# rmw_zenoh's own: how long after a message it is told again that there was one.
_SPORADIC_S = 0.5


@dataclass(frozen=True, kw_only=True)
class Topic:
    """A ROS 2 topic.

    Attributes:
        name: Without the first slash.
        kind: As in `sensor_msgs/msg/JointState`.
        depth: How many messages are kept for who is slow, or late.
        latched: Who comes late gets the last of them (transient local).
    """

    name: str
    kind: str
    depth: int = 10
    latched: bool = False
    priority: Priority = Priority.DATA

    @property
    def qos(self) -> str:
        """Reliable, keep last: what differs from ROS 2's default stands there, the rest is empty."""
        return f":{1 if self.latched else ''}:,{self.depth}:,:,:,,"

    @property
    def dds_type(self) -> str:
        """Its type as DDS names it."""
        package, _, name = self.kind.split("/")
        return f"{package}::msg::dds_::{name}_"

    @property
    def type_hash(self) -> str:
        """Of its type's definition, RIHS01."""
        return str(_STORE.hash_rihs01(self.kind))

    def key(self, domain: int) -> str:
        """Where its messages travel."""
        return f"{domain}/{self.name}/{self.dds_type}/{self.type_hash}"


def message(kind: str, **fields: Any) -> Any:
    """A message of a ROS 2 type."""
    return _STORE.types[kind](**fields)


class NodeNameError(ServiceError):
    """A name that no ROS 2 node can have."""


class Node:
    """A ROS 2 node of a Zenoh session: its publishers, and the tokens that tell of them."""

    def __init__(self, session: zenoh.Session, name: str, *, domain: int) -> None:
        if not _NODE_NAME.fullmatch(name):
            raise NodeNameError(
                f"node {name!r} cannot be used: letters, digits and '_', beginning with a letter or '_'"
            )
        self.name = name
        self.domain = domain
        self._session = session
        self._entities = _NODE
        prefix = self._token(_NODE, "NN")
        self._tokens = [session.liveliness().declare_token(f"{prefix}/{name}")]
        self._publishers: list[Publisher] = []

    def publish(self, topic: Topic) -> "Publisher":
        """A publisher of a topic, told to the ROS graph."""
        self._entities += 1
        publisher = Publisher(self._session, topic, topic.key(self.domain))
        self._publishers.append(publisher)
        place = f"{self._token(self._entities, 'MP')}/{self.name}/%{topic.name.replace('/', '%')}"
        key = f"{place}/{topic.dds_type}/{topic.type_hash}/{topic.qos}"
        self._tokens.append(self._session.liveliness().declare_token(key))
        return publisher

    def _token(self, entity: int, kind: str) -> str:
        zid = self._session.info.zid()
        return f"{_TOKENS}/{self.domain}/{zid}/{_NODE}/{entity}/{kind}/%/%"

    def close(self) -> None:
        """The node is gone from the ROS graph."""
        for token in self._tokens:
            token.undeclare()
        for publisher in self._publishers:
            publisher.close()


class Publisher:
    """A publisher of a ROS 2 topic."""

    def __init__(self, session: zenoh.Session, topic: Topic, key: str) -> None:
        self.topic = topic
        self._identity = secrets.token_bytes(16)
        self._sequence = 0
        self._publisher: Any = _declare(session, topic, key)

    def put(self, told: Any, *, source_time_ns: int) -> None:
        """Publish a message of the topic's type.

        Args:
            source_time_ns: When what it tells was so, ns since the Unix epoch.
        """
        self._sequence += 1
        attachment = _ATTACHMENT.pack(self._sequence, source_time_ns, 16, self._identity)
        payload = bytes(_STORE.serialize_cdr(told, self.topic.kind))
        self._publisher.put(payload, attachment=attachment)

    @property
    def watched(self) -> bool:
        """Whether anybody subscribes to it now; of a latched topic it does not matter."""
        if not isinstance(self._publisher, zenoh.Publisher):
            return True
        status: Any = self._publisher.matching_status  # typed as bool, but an object that is always true
        return bool(status.matching)

    def close(self) -> None:
        """Publish no more."""
        self._publisher.undeclare()


def _declare(session: zenoh.Session, topic: Topic, key: str) -> zenoh.Publisher | zenoh.ext.AdvancedPublisher:
    # rmw_zenoh drops too, unless everything is to be kept: a slow node must not stall a robot's states.
    drop, priority = zenoh.CongestionControl.DROP, getattr(zenoh.Priority, topic.priority.value)
    if topic.latched:
        return zenoh.ext.declare_advanced_publisher(
            session,
            key,
            priority=priority,
            congestion_control=drop,
            cache=zenoh.ext.CacheConfig(topic.depth),
            sample_miss_detection=zenoh.ext.MissDetectionConfig(
                heartbeat=None, sporadic_heartbeat=_SPORADIC_S
            ),
            publisher_detection=True,
        )
    return session.declare_publisher(key, priority=priority, congestion_control=drop)
