"""Wire format of rmw_zenoh: keys, attachments and liveliness tokens of ROS 2 topics.

<domain>/<topic>/<package>::msg::dds_::<Type>_/<type hash>                       data: CDR with its header
@ros2_lv/<domain>/<session>/<node>/<node>/NN/%/%/<name>                          a node
@ros2_lv/<domain>/<session>/<node>/<entity>/MP/%/%/<name>/%<topic>/<type>/<hash>/<qos>   a publisher
<data key>/@adv/pub/<session>/<entity>/...                                       a late joiner's query

Attachment: sequence (int64), source time (int64, ns), publisher (its length, then 16 bytes).
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

from robomesh.contract.topics import Priority
from services.errors import ServiceError

_STORE = get_typestore(Stores.ROS2_JAZZY)
_ATTACHMENT = struct.Struct("<qqB16s")
_TOKENS = "@ros2_lv"
_NODE = 0
_NODE_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
# rmw_zenoh's value: delay of the heartbeat that follows a message.
_SPORADIC_S = 0.5


@dataclass(frozen=True, kw_only=True)
class Topic:
    """A ROS 2 topic.

    Attributes:
        name: Name without the first slash.
        kind: Type, for example `sensor_msgs/msg/JointState`.
        depth: Number of messages to keep for slow or late subscribers.
        latched: Late subscribers get the last messages (transient local).
    """

    name: str
    kind: str
    depth: int = 10
    latched: bool = False
    priority: Priority = Priority.DATA

    @property
    def qos(self) -> str:
        """Quality of service: reliable, keep last. Values equal to ROS 2's defaults are empty."""
        return f":{1 if self.latched else ''}:,{self.depth}:,:,:,,"

    @property
    def dds_type(self) -> str:
        """DDS name of the type."""
        package, _, name = self.kind.split("/")
        return f"{package}::msg::dds_::{name}_"

    @property
    def type_hash(self) -> str:
        """RIHS01 hash of the type's definition."""
        return str(_STORE.hash_rihs01(self.kind))

    def key(self, domain: int) -> str:
        """Return the key of its messages."""
        return f"{domain}/{self.name}/{self.dds_type}/{self.type_hash}"


def message(kind: str, **fields: Any) -> Any:
    """Return a message of a ROS 2 type."""
    return _STORE.types[kind](**fields)


class NodeNameError(ServiceError):
    """The name of a ROS 2 node is invalid."""


class Node:
    """A ROS 2 node of a Zenoh session: its publishers and their liveliness tokens."""

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
        """Create a publisher of a topic and announce it in the ROS graph."""
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
        """Remove the node from the ROS graph."""
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

    def put(self, content: Any, *, source_time_ns: int) -> None:
        """Publish a message of the topic's type.

        Args:
            source_time_ns: Time of the content, ns since the Unix epoch.
        """
        self._sequence += 1
        attachment = _ATTACHMENT.pack(self._sequence, source_time_ns, 16, self._identity)
        payload = bytes(_STORE.serialize_cdr(content, self.topic.kind))
        self._publisher.put(payload, attachment=attachment)

    @property
    def watched(self) -> bool:
        """True if the topic has a subscriber now; always True for a latched topic."""
        if not isinstance(self._publisher, zenoh.Publisher):
            return True
        status: Any = self._publisher.matching_status  # typed as bool, but an object that is always true
        return bool(status.matching)

    def close(self) -> None:
        """Undeclare the publisher."""
        self._publisher.undeclare()


def _declare(session: zenoh.Session, topic: Topic, key: str) -> zenoh.Publisher | zenoh.ext.AdvancedPublisher:
    # Drop, as rmw_zenoh does except for "keep all": a slow node must not delay a robot's states.
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
