"""The table of topics and requests.

The only place for rates, priorities, schemas and rights; publishers, recorder, monitors, access control,
documentation and tests read it.
"""

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.message import Message

from robomesh import reason_codes as codes
from robomesh.contract.keys import check_chunk
from robomesh.contract.topic_schema import EVERYONE, PEOPLE, SERVICES, History, Priority, Request, Role, Topic
from robomesh.errors import KeyNameError, UnknownTopicError
from robomesh.schemas import robomesh_pb2 as schema

__all__ = [
    "EVERYONE",
    "OF_ARM",
    "PEOPLE",
    "REQUESTS",
    "SCHEMAS",
    "SERVICES",
    "TOPICS",
    "History",
    "Priority",
    "Request",
    "Role",
    "Topic",
    "check_operator",
    "request",
    "stale_after_s",
    "topic",
]


_GATEWAY = frozenset({Role.GATEWAY})
# A player publishes only robots named replay-<id>.
_GATEWAY_OR_REPLAY = frozenset({Role.GATEWAY, Role.PLAYER})
_KINEMATICS_OR_REPLAY = frozenset({Role.KINEMATICS, Role.PLAYER})
_STORE = frozenset({Role.STORE})
_COMMANDERS = frozenset({Role.OPERATOR, Role.ENGINEER, Role.CONSOLE})
# Who may place fixtures is not everyone who may move a robot.
_CELL_EDITORS = frozenset({Role.ENGINEER, Role.CONSOLE})


_TOPICS = (
    Topic(
        name="joints",
        schema=JointStates,
        rate_hz=100.0,
        priority=Priority.REAL_TIME,
        stale_after_s=1.0,
        publishers=_GATEWAY_OR_REPLAY,
    ),
    Topic(
        name="joints/slow",
        schema=JointStates,
        rate_hz=10.0,
        priority=Priority.INTERACTIVE_HIGH,
        stale_after_s=1.0,
        recorded=False,  # the same states as `joints`, thinned
        publishers=_GATEWAY_OR_REPLAY,
    ),
    Topic(
        name="units",
        schema=schema.UnitCounts,
        heartbeat_s=1.0,
        priority=Priority.DATA,
        stale_after_s=3.0,
        publishers=_GATEWAY_OR_REPLAY,
    ),
    Topic(
        name="controller",
        schema=schema.ControllerState,
        heartbeat_s=1.0,
        priority=Priority.INTERACTIVE_HIGH,
        stale_after_s=3.0,
        publishers=_GATEWAY_OR_REPLAY,
    ),
    # On change at most 10 Hz, of texts and booleans at most 50 Hz; otherwise once a second while the
    # controller reports: `protocol_gateway/telemetry/signals.py`.
    Topic(
        name="signals",
        schema=schema.Signals,
        rate_hz=10.0,
        priority=Priority.DATA_HIGH,
        stale_after_s=3.0,
        publishers=_GATEWAY_OR_REPLAY,
    ),
    Topic(name="raw", schema=schema.RawRecord, priority=Priority.DATA_LOW, publishers=_GATEWAY_OR_REPLAY),
    Topic(
        name="frames",
        schema=FrameTransforms,
        rate_hz=60.0,
        priority=Priority.INTERACTIVE_HIGH,
        stale_after_s=1.0,
        publishers=_KINEMATICS_OR_REPLAY,
    ),
    Topic(
        name="kinematics",
        schema=schema.KinematicState,
        rate_hz=20.0,
        priority=Priority.DATA_HIGH,
        stale_after_s=1.0,
        publishers=_KINEMATICS_OR_REPLAY,
    ),
    Topic(
        name="lease",
        schema=schema.Lease,
        heartbeat_s=1.0,
        priority=Priority.INTERACTIVE_HIGH,
        stale_after_s=3.0,
        publishers=_GATEWAY_OR_REPLAY,
    ),
    Topic(
        name="events",
        schema=schema.Event,
        history=History.LAST_100,
        history_schema=schema.EventList,
        recovered=True,
        priority=Priority.INTERACTIVE_LOW,
        publishers=_GATEWAY_OR_REPLAY,
    ),
    # Events of services other than the gateway. Each service has a key, because two publishers of one key
    # would send two replies to a `get`.
    Topic(
        name="events/*",
        schema=schema.Event,
        history=History.LAST_100,
        history_schema=schema.EventList,
        recovered=True,
        priority=Priority.INTERACTIVE_LOW,
        publishers=SERVICES - _GATEWAY,
    ),
    Topic(
        name="audit",
        schema=schema.AuditEntry,
        history=History.LAST_100,
        history_schema=schema.AuditList,
        recovered=True,
        priority=Priority.INTERACTIVE_LOW,
        publishers=_GATEWAY_OR_REPLAY,
    ),
    Topic(
        name="program",
        schema=schema.ProgramState,
        heartbeat_s=1.0,
        priority=Priority.INTERACTIVE_HIGH,
        stale_after_s=3.0,
        publishers=_GATEWAY_OR_REPLAY,
    ),
    Topic(
        name="program/source",
        schema=schema.ProgramSource,
        priority=Priority.INTERACTIVE_LOW,
        publishers=_GATEWAY_OR_REPLAY,
    ),
    Topic(
        name="description",
        schema=schema.Description,
        priority=Priority.DATA,
        publishers=_KINEMATICS_OR_REPLAY,
    ),
    Topic(
        name="cell",
        schema=schema.CellState,
        recorded=False,  # `description` has what the cell contains
        priority=Priority.DATA,
        publishers=_GATEWAY,
    ),
    Topic(
        name="cell/shown",
        schema=schema.CellShown,
        recorded=False,
        priority=Priority.INTERACTIVE_LOW,
        publishers=frozenset({Role.KINEMATICS}),
    ),
    Topic(
        name="programs",
        schema=schema.ProgramList,
        recorded=False,  # the site's work, not the robot's state
        priority=Priority.DATA,
        publishers=_STORE,
    ),
    # Below a site's `-`.
    Topic(
        name="layouts",
        schema=schema.LayoutList,
        recorded=False,  # the site's work, not a robot's state
        priority=Priority.DATA,
        publishers=_STORE,
    ),
    Topic(
        name="recording",
        schema=schema.Recording,
        heartbeat_s=1.0,
        recorded=False,  # state of the recording itself
        priority=Priority.DATA,
        stale_after_s=3.0,
        publishers=frozenset({Role.RECORDER}),
    ),
    Topic(
        name="replay",
        schema=schema.ReplayState,
        heartbeat_s=0.2,
        recorded=False,
        priority=Priority.DATA,
        stale_after_s=3.0,
        publishers=frozenset({Role.PLAYER}),
    ),
    Topic(
        name="video/*",
        schema=CompressedVideo,
        rate_hz=30.0,
        history=History.KEY_FRAME,
        history_schema=schema.VideoFrames,
        priority=Priority.DATA_LOW,
        stale_after_s=1.0,
        publishers=frozenset({Role.RENDERER, Role.PLAYER}),  # a player's views are named recorded-<view>
    ),
    Topic(
        name="image/*",
        schema=CompressedImage,
        rate_hz=5.0,
        recorded=False,  # can be drawn from the recorded states
        priority=Priority.BACKGROUND,
        publishers=frozenset({Role.RENDERER}),
    ),
    # This and the following topics are below a site's `-`. The chunk is <service>.<id>: one key a process.
    Topic(
        name="health/*",
        schema=schema.ServiceHealth,
        heartbeat_s=2.0,
        recorded=False,
        priority=Priority.BACKGROUND,
        stale_after_s=6.0,
        publishers=SERVICES,
    ),
    Topic(
        name="mesh",
        schema=schema.MeshState,
        heartbeat_s=2.0,
        recorded=False,
        priority=Priority.DATA,
        stale_after_s=6.0,
        publishers=frozenset({Role.WATCH}),
    ),
    Topic(
        name="alarms",
        schema=schema.AlarmList,
        heartbeat_s=1.0,
        recorded=False,
        priority=Priority.INTERACTIVE_HIGH,
        stale_after_s=3.0,
        publishers=frozenset({Role.WATCH}),
    ),
)

# Bytes of requests to a gateway. A longer stop stops too, but its texts are lost, so it may have more. JSON
# writes a character of a program as up to six.
_SHORT, _STOP, _WITH_PROGRAM, _CELL = 16 * 1024, 256 * 1024, 512 * 1024, 128 * 1024

_REQUESTS = (
    Request(
        name="stop",
        request=schema.StopRequest,
        answer=schema.StopAnswer,
        priority=Priority.REAL_TIME,
        owners=_GATEWAY_OR_REPLAY,
        askers=EVERYONE,
        wildcard=True,
        unread=True,
        own_link="stop",
        both_links=True,
        longest=_STOP,
    ),
    Request(
        name="lease/request/*",
        request=schema.LeaseRequest,
        answer=schema.LeaseAnswer,
        priority=Priority.REAL_TIME,
        owners=_GATEWAY_OR_REPLAY,
        askers=_COMMANDERS,
        own_link="requests",
        in_name=True,
        longest=_SHORT,
    ),
    Request(
        name="command/*",
        request=schema.CommandRequest,
        answer=schema.CommandAnswer,
        priority=Priority.REAL_TIME,
        owners=_GATEWAY_OR_REPLAY,
        askers=_COMMANDERS,
        own_link="requests",
        in_name=True,
        longest=_WITH_PROGRAM,
    ),
    # Keep-alives of a jog, with the operator's name.
    Request(
        name="jog/*",
        request=schema.JogRequest,
        answer=schema.JogAnswer,
        priority=Priority.REAL_TIME,
        owners=_GATEWAY_OR_REPLAY,
        askers=_COMMANDERS,
        own_link="requests",
        in_name=True,
        longest=_SHORT,
    ),
    Request(
        name="audit/find",
        request=schema.AuditQuery,
        answer=schema.AuditList,
        priority=Priority.BACKGROUND,
        owners=_GATEWAY,
        askers=EVERYONE,
        own_link="queries",
        longest=_SHORT,
    ),
    # With the engineer's name.
    Request(
        name="cell/request/*",
        request=schema.CellRequest,
        answer=schema.CellAnswer,
        priority=Priority.DATA,
        owners=_GATEWAY,
        askers=_CELL_EDITORS,
        own_link="queries",
        in_name=True,
        longest=_CELL,
    ),
    Request(
        name="cell/prepare",
        request=schema.CellPreparation,
        answer=schema.CellPrepared,
        priority=Priority.DATA,
        owners=frozenset({Role.KINEMATICS}),
        askers=_GATEWAY,
    ),
    Request(
        name="simulator/fault",
        request=schema.FaultRequest,
        answer=schema.FaultAnswer,
        priority=Priority.BACKGROUND,
        owners=frozenset({Role.SIMULATOR}),
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
        name="kinematics/inverse",
        request=schema.InverseRequest,
        answer=schema.InverseAnswer,
        priority=Priority.DATA,
        owners=frozenset({Role.KINEMATICS}),
        askers=EVERYONE,
    ),
    Request(
        name="kinematics/check/*",
        request=schema.CheckRequest,
        answer=schema.CheckAnswer,
        priority=Priority.DATA,
        owners=frozenset({Role.KINEMATICS}),
        askers=EVERYONE,
        in_name=True,
    ),
    Request(
        name="video/*/keyframe/*",
        request=schema.KeyFrameRequest,
        answer=schema.KeyFrameAnswer,
        priority=Priority.DATA,
        owners=frozenset({Role.RENDERER}),
        askers=EVERYONE,
        in_name=True,
    ),
    Request(
        name="views/*",
        request=schema.ViewRequest,
        answer=schema.ViewAnswer,
        priority=Priority.DATA,
        owners=frozenset({Role.RENDERER}),
        askers=EVERYONE,
        in_name=True,
    ),
    Request(
        name="mesh/*",
        request=None,
        answer=None,
        priority=Priority.DATA,
        owners=_KINEMATICS_OR_REPLAY,
        askers=EVERYONE,
    ),
    Request(
        name="recorder/request",
        request=schema.RecorderRequest,
        answer=schema.Recording,
        priority=Priority.BACKGROUND,
        owners=frozenset({Role.RECORDER, Role.PLAYER}),  # a player refuses: a replay is already recorded
        askers=_COMMANDERS,
    ),
    Request(
        name="recordings/list",
        request=schema.RecordingListQuery,
        answer=schema.RecordingList,
        priority=Priority.BACKGROUND,
        owners=frozenset({Role.RECORDER}),
        askers=EVERYONE,
    ),
    Request(
        name="recordings/info",
        request=schema.RecordingQuery,
        answer=schema.Recording,
        priority=Priority.BACKGROUND,
        owners=frozenset({Role.RECORDER}),
        askers=EVERYONE,
    ),
    Request(
        name="recordings/range/*",
        request=schema.RangeRequest,
        answer=schema.RecordedMessages,
        priority=Priority.BACKGROUND,
        owners=frozenset({Role.RECORDER}),
        askers=EVERYONE,
        in_name=True,
    ),
    Request(
        name="recordings/series/*",
        request=schema.SeriesRequest,
        answer=schema.SeriesAnswer,
        priority=Priority.BACKGROUND,
        owners=frozenset({Role.RECORDER}),
        askers=EVERYONE,
        in_name=True,
    ),
    Request(
        name="recordings/piece/*",
        request=schema.PieceRequest,
        answer=schema.Piece,
        priority=Priority.BACKGROUND,
        owners=frozenset({Role.RECORDER}),
        askers=EVERYONE,
        in_name=True,
    ),
    # Below a site's `-`, with the author's name.
    Request(
        name="recordings/request/*",
        request=schema.RecordingRequest,
        answer=schema.Recording,
        priority=Priority.BACKGROUND,
        owners=frozenset({Role.RECORDER}),
        askers=_COMMANDERS,
        in_name=True,
    ),
    # Below a site's `-`.
    Request(
        name="player/open",
        request=schema.PlayRequest,
        answer=schema.ReplayState,
        priority=Priority.DATA,
        owners=frozenset({Role.PLAYER}),
        askers=EVERYONE,
    ),
    # Below a site's `-`; the chunk is the id of a process.
    Request(
        name="clock/*",
        request=schema.ClockRequest,
        answer=schema.ClockAnswer,
        priority=Priority.INTERACTIVE_HIGH,
        owners=SERVICES,
        askers=EVERYONE,
    ),
    # Below a site's `-`, with an operator's name.
    Request(
        name="alarms/request/*",
        request=schema.AlarmRequest,
        answer=schema.AlarmList,
        priority=Priority.INTERACTIVE_HIGH,
        owners=frozenset({Role.WATCH}),
        askers=_COMMANDERS,
        in_name=True,
    ),
    # Below a site's `-`, with the author's name.
    Request(
        name="programs/request/*",
        request=schema.ProgramRequest,
        answer=schema.ProgramAnswer,
        priority=Priority.DATA,
        owners=_STORE,
        askers=_COMMANDERS,
        in_name=True,
    ),
    # Below a site's `-`.
    Request(
        name="programs/read",
        request=schema.ProgramQuery,
        answer=schema.ProgramContent,
        priority=Priority.DATA,
        owners=_STORE,
        askers=EVERYONE,
    ),
    # Below a site's `-`, with the author's name.
    Request(
        name="layouts/request/*",
        request=schema.LayoutRequest,
        answer=schema.LayoutList,
        priority=Priority.DATA,
        owners=_STORE,
        askers=_COMMANDERS,
        in_name=True,
    ),
    # Below a site's `-`, with the author's name.
    Request(
        name="notes/request/*",
        request=schema.NoteRequest,
        answer=schema.Event,
        priority=Priority.INTERACTIVE_LOW,
        owners=_STORE,
        askers=_COMMANDERS,
        in_name=True,
    ),
    # Below a site's `-`, with an administrator's name: withdraws the note of another author.
    Request(
        name="notes/withdraw/*",
        request=schema.NoteRequest,
        answer=schema.Event,
        priority=Priority.INTERACTIVE_LOW,
        owners=_STORE,
        askers=frozenset({Role.CONSOLE}),
        in_name=True,
        administrators=True,
    ),
    # Below a site's `-`.
    Request(
        name="notes/read",
        request=schema.NoteQuery,
        answer=schema.EventList,
        priority=Priority.DATA,
        owners=_STORE,
        askers=EVERYONE,
    ),
    # Below replay-<id>.
    Request(
        name="replay/request",
        request=schema.ReplayRequest,
        answer=schema.ReplayState,
        priority=Priority.DATA,
        owners=frozenset({Role.PLAYER}),
        askers=EVERYONE,
    ),
)

TOPICS: Mapping[str, Topic] = MappingProxyType({row.name: row for row in _TOPICS})
# By the full name of the schema: "foxglove.JointStates".
SCHEMAS: Mapping[str, type[Message]] = MappingProxyType(
    {row.schema.DESCRIPTOR.full_name: row.schema for row in _TOPICS}
)
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


@lru_cache(4096)  # called for each message
def topic(name: str) -> Topic:
    """Return the row of a topic: `joints`, `video/top`.

    Raises:
        UnknownTopicError: If the topic is not in the table.
    """
    row = _row_name(name, TOPICS)
    if row is None:
        raise UnknownTopicError(codes.TOPIC_UNKNOWN(name=name, names=", ".join(TOPICS)))
    return TOPICS[row]


OF_ARM = frozenset({"joints", "joints/slow", "frames", "kinematics"})
"""Topics with the joints, and with what is computed from them: a robot may have another stale time."""


def stale_after_s(name: str, description: schema.Description | None) -> float | None:
    """Return the age from which a robot's message must not be shown as live [s]; None: it does not age.

    Args:
        description: The robot's, which has the time for its joints and what follows from them; None: not
            known, so the topic's own applies.

    Raises:
        UnknownTopicError: If the topic is not in the table.
    """
    row = topic(name)
    if name in OF_ARM and description is not None and description.HasField("stale_after_s"):
        return description.stale_after_s
    return row.stale_after_s


@lru_cache(4096)
def request(name: str) -> Request:
    """Return the row of a request: `stop`, `command/li`.

    Raises:
        UnknownTopicError: If the request is not in the table.
    """
    row = _row_name(name, REQUESTS)
    if row is None:
        raise UnknownTopicError(codes.REQUEST_UNKNOWN(name=name, names=", ".join(REQUESTS)))
    return REQUESTS[row]


def check_operator(name: str) -> str:
    """Return the name if it is valid for an operator.

    Raises:
        KeyNameError: If it is invalid in a key, or equals a request's name: an access rule for that request
            would match the operator's keys.
    """
    if name in REQUESTS:
        raise KeyNameError(codes.OPERATOR_RESERVED(name=name))
    return check_chunk(name)
