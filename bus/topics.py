"""The one table of topics and requests.

Publishers, recorder, monitors, access control, documentation and tests read it; nobody else
knows a rate, a priority, a schema or a right.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.message import Message

from bus.errors import UnknownTopicError
from bus.schemas import robomesh_pb2 as schema


class Priority(Enum):
    """Zenoh's priorities, by their own names; everything is dropped, never queued."""

    REAL_TIME = "REAL_TIME"
    INTERACTIVE_HIGH = "INTERACTIVE_HIGH"
    INTERACTIVE_LOW = "INTERACTIVE_LOW"
    DATA_HIGH = "DATA_HIGH"
    DATA = "DATA"
    DATA_LOW = "DATA_LOW"
    BACKGROUND = "BACKGROUND"


class History(Enum):
    """What a plain `get` on a topic's key answers with, always as one reply."""

    NONE = "none"
    LAST = "the last value"
    LAST_100 = "a list message of the last 100"
    KEY_FRAME = "the frames since the last key frame"


class Role(Enum):
    """Who takes part in the mesh. Each right below names the roles that have it."""

    GATEWAY = "gateway"
    KINEMATICS = "kinematics"
    RECORDER = "recorder"
    RENDERER = "renderer"
    CONSOLE = "console"
    OPERATOR = "operator"
    MONITOR = "monitor"


EVERYONE = frozenset(Role)
_GATEWAY = frozenset({Role.GATEWAY})
_COMMANDERS = frozenset({Role.OPERATOR, Role.CONSOLE})


@dataclass(frozen=True, kw_only=True)
class Topic:
    """A row: something published.

    Attributes:
        name: Topic below the robot's key; `*` stands for one chunk.
        rate_hz: Highest rate; None: on change or as it comes.
        heartbeat_s: Published at least this often while its publisher lives; None: no such promise.
        stale_after_s: Age from which it must not look live; None: it does not age.
        recovered: Lost samples are asked for again (Zenoh's advanced publisher and subscriber).
    """

    name: str
    schema: type[Message]
    priority: Priority
    rate_hz: float | None = None
    heartbeat_s: float | None = None
    history: History = History.LAST
    history_schema: type[Message] | None = None
    recorded: bool = True
    recovered: bool = False
    stale_after_s: float | None = None
    publishers: frozenset[Role]
    subscribers: frozenset[Role] = EVERYONE


@dataclass(frozen=True, kw_only=True)
class Request:
    """A row: something asked, below the robot's key; `*` stands for one chunk.

    Attributes:
        answer: Schema of the answer; None: plain bytes.
        wildcard: May be asked on a key with a wildcard.
        unread: A payload that cannot be read counts as an empty one: a stop is a stop.
    """

    name: str
    request: type[Message] | None
    answer: type[Message] | None
    priority: Priority
    owners: frozenset[Role]
    askers: frozenset[Role]
    wildcard: bool = False
    unread: bool = False


_TOPICS = (
    Topic(
        name="joints",
        schema=JointStates,
        rate_hz=100.0,
        priority=Priority.REAL_TIME,
        stale_after_s=1.0,
        publishers=_GATEWAY,
    ),
    Topic(
        name="joints/slow",
        schema=JointStates,
        rate_hz=10.0,
        priority=Priority.INTERACTIVE_HIGH,
        stale_after_s=1.0,
        recorded=False,  # the same states as `joints`, thinned
        publishers=_GATEWAY,
    ),
    Topic(
        name="controller",
        schema=schema.ControllerState,
        heartbeat_s=1.0,
        priority=Priority.INTERACTIVE_HIGH,
        stale_after_s=3.0,
        publishers=_GATEWAY,
    ),
    Topic(name="raw", schema=schema.RawRecord, priority=Priority.DATA_LOW, publishers=_GATEWAY),
    Topic(
        name="frames",
        schema=FrameTransforms,
        rate_hz=60.0,
        priority=Priority.INTERACTIVE_HIGH,
        stale_after_s=1.0,
        publishers=frozenset({Role.KINEMATICS}),
    ),
    Topic(
        name="kinematics",
        schema=schema.KinematicState,
        rate_hz=20.0,
        priority=Priority.DATA_HIGH,
        stale_after_s=1.0,
        publishers=frozenset({Role.KINEMATICS}),
    ),
    Topic(
        name="lease",
        schema=schema.Lease,
        heartbeat_s=1.0,
        priority=Priority.INTERACTIVE_HIGH,
        stale_after_s=3.0,
        publishers=_GATEWAY,
    ),
    Topic(
        name="events",
        schema=schema.Event,
        history=History.LAST_100,
        history_schema=schema.EventList,
        recovered=True,
        priority=Priority.INTERACTIVE_LOW,
        publishers=_GATEWAY,
    ),
    Topic(
        name="audit",
        schema=schema.AuditEntry,
        history=History.LAST_100,
        history_schema=schema.AuditList,
        recovered=True,
        priority=Priority.INTERACTIVE_LOW,
        publishers=_GATEWAY,
    ),
    Topic(
        name="description",
        schema=schema.Description,
        priority=Priority.DATA,
        publishers=frozenset({Role.KINEMATICS}),
    ),
    Topic(
        name="video/*",
        schema=CompressedVideo,
        rate_hz=30.0,
        history=History.KEY_FRAME,
        history_schema=schema.VideoFrames,
        priority=Priority.DATA_LOW,
        stale_after_s=1.0,
        publishers=frozenset({Role.RENDERER}),
    ),
    Topic(
        name="image/*",
        schema=CompressedImage,
        rate_hz=5.0,
        recorded=False,  # pictures of what the recording holds already
        priority=Priority.BACKGROUND,
        publishers=frozenset({Role.RENDERER}),
    ),
)

_REQUESTS = (
    Request(
        name="stop",
        request=schema.StopRequest,
        answer=schema.StopAnswer,
        priority=Priority.REAL_TIME,
        owners=_GATEWAY,
        askers=EVERYONE,
        wildcard=True,
        unread=True,
    ),
    Request(
        name="lease/request/*",
        request=schema.LeaseRequest,
        answer=schema.LeaseAnswer,
        priority=Priority.REAL_TIME,
        owners=_GATEWAY,
        askers=_COMMANDERS,
    ),
    Request(
        name="command/*",
        request=schema.CommandRequest,
        answer=schema.CommandAnswer,
        priority=Priority.REAL_TIME,
        owners=_GATEWAY,
        askers=_COMMANDERS,
    ),
    Request(
        name="kinematics/forward",
        request=schema.ForwardRequest,
        answer=schema.ForwardAnswer,
        priority=Priority.DATA,
        owners=frozenset({Role.KINEMATICS}),
        askers=EVERYONE,
    ),
    Request(
        name="video/*/keyframe",
        request=schema.KeyFrameRequest,
        answer=schema.KeyFrameAnswer,
        priority=Priority.DATA,
        owners=frozenset({Role.RENDERER}),
        askers=EVERYONE,
    ),
    Request(
        name="mesh/*",
        request=None,
        answer=None,
        priority=Priority.BACKGROUND,
        owners=frozenset({Role.KINEMATICS}),
        askers=EVERYONE,
    ),
    Request(
        name="recorder/request",
        request=schema.RecorderRequest,
        answer=schema.Recording,
        priority=Priority.BACKGROUND,
        owners=frozenset({Role.RECORDER}),
        askers=_COMMANDERS,
    ),
    Request(
        name="recordings/list",
        request=None,
        answer=schema.RecordingList,
        priority=Priority.BACKGROUND,
        owners=frozenset({Role.RECORDER}),
        askers=EVERYONE,
    ),
)

TOPICS: Mapping[str, Topic] = MappingProxyType({row.name: row for row in _TOPICS})
REQUESTS: Mapping[str, Request] = MappingProxyType({row.name: row for row in _REQUESTS})


def _row_name(name: str, rows: Mapping[str, object]) -> str | None:
    if name in rows:
        return name
    chunks = name.split("/")
    for row in rows:
        pattern = row.split("/")
        if len(pattern) == len(chunks) and all(p in ("*", c) for p, c in zip(pattern, chunks, strict=True)):
            return row
    return None


def topic(name: str) -> Topic:
    """The row of a topic: `joints`, `video/top`.

    Raises:
        UnknownTopicError: If the table has none.
    """
    row = _row_name(name, TOPICS)
    if row is None:
        raise UnknownTopicError(f"no topic {name!r}; there are {', '.join(TOPICS)}")
    return TOPICS[row]


def request(name: str) -> Request:
    """The row of a request: `stop`, `command/li`.

    Raises:
        UnknownTopicError: If the table has none.
    """
    row = _row_name(name, REQUESTS)
    if row is None:
        raise UnknownTopicError(f"no request {name!r}; there are {', '.join(REQUESTS)}")
    return REQUESTS[row]
