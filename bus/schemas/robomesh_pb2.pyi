import datetime

from google.protobuf import duration_pb2 as _duration_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class ControllerState(_message.Message):
    __slots__ = ("timestamp", "link", "mode", "activity", "homed", "trace", "fault", "last_unit_age_s", "controller_time_s", "counters", "read_only", "stop", "link_text", "rate_hz")
    class Link(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        LINK_UNSPECIFIED: _ClassVar[ControllerState.Link]
        DOWN: _ClassVar[ControllerState.Link]
        UP: _ClassVar[ControllerState.Link]
        SILENT: _ClassVar[ControllerState.Link]
    LINK_UNSPECIFIED: ControllerState.Link
    DOWN: ControllerState.Link
    UP: ControllerState.Link
    SILENT: ControllerState.Link
    class Mode(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        MODE_UNSPECIFIED: _ClassVar[ControllerState.Mode]
        MODE_UNKNOWN: _ClassVar[ControllerState.Mode]
        REMOTE: _ClassVar[ControllerState.Mode]
        LOCAL: _ClassVar[ControllerState.Mode]
    MODE_UNSPECIFIED: ControllerState.Mode
    MODE_UNKNOWN: ControllerState.Mode
    REMOTE: ControllerState.Mode
    LOCAL: ControllerState.Mode
    class Activity(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTIVITY_UNSPECIFIED: _ClassVar[ControllerState.Activity]
        ACTIVITY_UNKNOWN: _ClassVar[ControllerState.Activity]
        IDLE: _ClassVar[ControllerState.Activity]
        MOVING: _ClassVar[ControllerState.Activity]
        HOMING: _ClassVar[ControllerState.Activity]
        HOLDING: _ClassVar[ControllerState.Activity]
        STOPPED: _ClassVar[ControllerState.Activity]
        FAULT: _ClassVar[ControllerState.Activity]
    ACTIVITY_UNSPECIFIED: ControllerState.Activity
    ACTIVITY_UNKNOWN: ControllerState.Activity
    IDLE: ControllerState.Activity
    MOVING: ControllerState.Activity
    HOMING: ControllerState.Activity
    HOLDING: ControllerState.Activity
    STOPPED: ControllerState.Activity
    FAULT: ControllerState.Activity
    class Known(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        KNOWN_UNSPECIFIED: _ClassVar[ControllerState.Known]
        UNKNOWN: _ClassVar[ControllerState.Known]
        YES: _ClassVar[ControllerState.Known]
        NO: _ClassVar[ControllerState.Known]
    KNOWN_UNSPECIFIED: ControllerState.Known
    UNKNOWN: ControllerState.Known
    YES: ControllerState.Known
    NO: ControllerState.Known
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    LINK_FIELD_NUMBER: _ClassVar[int]
    MODE_FIELD_NUMBER: _ClassVar[int]
    ACTIVITY_FIELD_NUMBER: _ClassVar[int]
    HOMED_FIELD_NUMBER: _ClassVar[int]
    TRACE_FIELD_NUMBER: _ClassVar[int]
    FAULT_FIELD_NUMBER: _ClassVar[int]
    LAST_UNIT_AGE_S_FIELD_NUMBER: _ClassVar[int]
    CONTROLLER_TIME_S_FIELD_NUMBER: _ClassVar[int]
    COUNTERS_FIELD_NUMBER: _ClassVar[int]
    READ_ONLY_FIELD_NUMBER: _ClassVar[int]
    STOP_FIELD_NUMBER: _ClassVar[int]
    LINK_TEXT_FIELD_NUMBER: _ClassVar[int]
    RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    link: ControllerState.Link
    mode: ControllerState.Mode
    activity: ControllerState.Activity
    homed: ControllerState.Known
    trace: ControllerState.Known
    fault: str
    last_unit_age_s: float
    controller_time_s: float
    counters: LinkCounters
    read_only: bool
    stop: StopState
    link_text: str
    rate_hz: float
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., link: _Optional[_Union[ControllerState.Link, str]] = ..., mode: _Optional[_Union[ControllerState.Mode, str]] = ..., activity: _Optional[_Union[ControllerState.Activity, str]] = ..., homed: _Optional[_Union[ControllerState.Known, str]] = ..., trace: _Optional[_Union[ControllerState.Known, str]] = ..., fault: _Optional[str] = ..., last_unit_age_s: _Optional[float] = ..., controller_time_s: _Optional[float] = ..., counters: _Optional[_Union[LinkCounters, _Mapping]] = ..., read_only: _Optional[bool] = ..., stop: _Optional[_Union[StopState, _Mapping]] = ..., link_text: _Optional[str] = ..., rate_hz: _Optional[float] = ...) -> None: ...

class LinkCounters(_message.Message):
    __slots__ = ("units_received", "units_malformed", "units_sent", "bytes_received", "bytes_sent", "records_unknown", "connections", "refusals")
    UNITS_RECEIVED_FIELD_NUMBER: _ClassVar[int]
    UNITS_MALFORMED_FIELD_NUMBER: _ClassVar[int]
    UNITS_SENT_FIELD_NUMBER: _ClassVar[int]
    BYTES_RECEIVED_FIELD_NUMBER: _ClassVar[int]
    BYTES_SENT_FIELD_NUMBER: _ClassVar[int]
    RECORDS_UNKNOWN_FIELD_NUMBER: _ClassVar[int]
    CONNECTIONS_FIELD_NUMBER: _ClassVar[int]
    REFUSALS_FIELD_NUMBER: _ClassVar[int]
    units_received: int
    units_malformed: int
    units_sent: int
    bytes_received: int
    bytes_sent: int
    records_unknown: int
    connections: int
    refusals: int
    def __init__(self, units_received: _Optional[int] = ..., units_malformed: _Optional[int] = ..., units_sent: _Optional[int] = ..., bytes_received: _Optional[int] = ..., bytes_sent: _Optional[int] = ..., records_unknown: _Optional[int] = ..., connections: _Optional[int] = ..., refusals: _Optional[int] = ...) -> None: ...

class StopState(_message.Message):
    __slots__ = ("id", "since", "by", "reason", "sent")
    ID_FIELD_NUMBER: _ClassVar[int]
    SINCE_FIELD_NUMBER: _ClassVar[int]
    BY_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    SENT_FIELD_NUMBER: _ClassVar[int]
    id: int
    since: _timestamp_pb2.Timestamp
    by: str
    reason: str
    sent: bool
    def __init__(self, id: _Optional[int] = ..., since: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., by: _Optional[str] = ..., reason: _Optional[str] = ..., sent: _Optional[bool] = ...) -> None: ...

class RawRecord(_message.Message):
    __slots__ = ("timestamp", "type", "items", "data")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    TYPE_FIELD_NUMBER: _ClassVar[int]
    ITEMS_FIELD_NUMBER: _ClassVar[int]
    DATA_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    type: str
    items: _containers.RepeatedScalarFieldContainer[str]
    data: bytes
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., type: _Optional[str] = ..., items: _Optional[_Iterable[str]] = ..., data: _Optional[bytes] = ...) -> None: ...

class KinematicState(_message.Message):
    __slots__ = ("timestamp", "tool_to_base", "linear_velocity", "angular_velocity", "manipulability", "limit_margins", "clearance")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    TOOL_TO_BASE_FIELD_NUMBER: _ClassVar[int]
    LINEAR_VELOCITY_FIELD_NUMBER: _ClassVar[int]
    ANGULAR_VELOCITY_FIELD_NUMBER: _ClassVar[int]
    MANIPULABILITY_FIELD_NUMBER: _ClassVar[int]
    LIMIT_MARGINS_FIELD_NUMBER: _ClassVar[int]
    CLEARANCE_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    tool_to_base: _containers.RepeatedScalarFieldContainer[float]
    linear_velocity: Vector3
    angular_velocity: Vector3
    manipulability: float
    limit_margins: _containers.RepeatedCompositeFieldContainer[LimitMargin]
    clearance: Clearance
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., tool_to_base: _Optional[_Iterable[float]] = ..., linear_velocity: _Optional[_Union[Vector3, _Mapping]] = ..., angular_velocity: _Optional[_Union[Vector3, _Mapping]] = ..., manipulability: _Optional[float] = ..., limit_margins: _Optional[_Iterable[_Union[LimitMargin, _Mapping]]] = ..., clearance: _Optional[_Union[Clearance, _Mapping]] = ...) -> None: ...

class Vector3(_message.Message):
    __slots__ = ("x", "y", "z")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    x: float
    y: float
    z: float
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., z: _Optional[float] = ...) -> None: ...

class LimitMargin(_message.Message):
    __slots__ = ("name", "lower", "upper")
    NAME_FIELD_NUMBER: _ClassVar[int]
    LOWER_FIELD_NUMBER: _ClassVar[int]
    UPPER_FIELD_NUMBER: _ClassVar[int]
    name: str
    lower: float
    upper: float
    def __init__(self, name: _Optional[str] = ..., lower: _Optional[float] = ..., upper: _Optional[float] = ...) -> None: ...

class Clearance(_message.Message):
    __slots__ = ("distance", "first", "second", "first_point", "second_point")
    DISTANCE_FIELD_NUMBER: _ClassVar[int]
    FIRST_FIELD_NUMBER: _ClassVar[int]
    SECOND_FIELD_NUMBER: _ClassVar[int]
    FIRST_POINT_FIELD_NUMBER: _ClassVar[int]
    SECOND_POINT_FIELD_NUMBER: _ClassVar[int]
    distance: float
    first: str
    second: str
    first_point: Vector3
    second_point: Vector3
    def __init__(self, distance: _Optional[float] = ..., first: _Optional[str] = ..., second: _Optional[str] = ..., first_point: _Optional[_Union[Vector3, _Mapping]] = ..., second_point: _Optional[_Union[Vector3, _Mapping]] = ...) -> None: ...

class Lease(_message.Message):
    __slots__ = ("timestamp", "holder", "since", "until", "offered_to", "motion")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    HOLDER_FIELD_NUMBER: _ClassVar[int]
    SINCE_FIELD_NUMBER: _ClassVar[int]
    UNTIL_FIELD_NUMBER: _ClassVar[int]
    OFFERED_TO_FIELD_NUMBER: _ClassVar[int]
    MOTION_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    holder: str
    since: _timestamp_pb2.Timestamp
    until: _timestamp_pb2.Timestamp
    offered_to: str
    motion: bool
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., holder: _Optional[str] = ..., since: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., until: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., offered_to: _Optional[str] = ..., motion: _Optional[bool] = ...) -> None: ...

class LeaseRequest(_message.Message):
    __slots__ = ("action", "lease", "ttl_s", "to", "reason")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_UNSPECIFIED: _ClassVar[LeaseRequest.Action]
        ACQUIRE: _ClassVar[LeaseRequest.Action]
        RENEW: _ClassVar[LeaseRequest.Action]
        RELEASE: _ClassVar[LeaseRequest.Action]
        OFFER: _ClassVar[LeaseRequest.Action]
        ACCEPT: _ClassVar[LeaseRequest.Action]
        TAKE: _ClassVar[LeaseRequest.Action]
    ACTION_UNSPECIFIED: LeaseRequest.Action
    ACQUIRE: LeaseRequest.Action
    RENEW: LeaseRequest.Action
    RELEASE: LeaseRequest.Action
    OFFER: LeaseRequest.Action
    ACCEPT: LeaseRequest.Action
    TAKE: LeaseRequest.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    LEASE_FIELD_NUMBER: _ClassVar[int]
    TTL_S_FIELD_NUMBER: _ClassVar[int]
    TO_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    action: LeaseRequest.Action
    lease: str
    ttl_s: float
    to: str
    reason: str
    def __init__(self, action: _Optional[_Union[LeaseRequest.Action, str]] = ..., lease: _Optional[str] = ..., ttl_s: _Optional[float] = ..., to: _Optional[str] = ..., reason: _Optional[str] = ...) -> None: ...

class LeaseAnswer(_message.Message):
    __slots__ = ("lease", "holder", "since", "until", "now")
    LEASE_FIELD_NUMBER: _ClassVar[int]
    HOLDER_FIELD_NUMBER: _ClassVar[int]
    SINCE_FIELD_NUMBER: _ClassVar[int]
    UNTIL_FIELD_NUMBER: _ClassVar[int]
    NOW_FIELD_NUMBER: _ClassVar[int]
    lease: str
    holder: str
    since: _timestamp_pb2.Timestamp
    until: _timestamp_pb2.Timestamp
    now: _timestamp_pb2.Timestamp
    def __init__(self, lease: _Optional[str] = ..., holder: _Optional[str] = ..., since: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., until: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., now: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...

class CommandRequest(_message.Message):
    __slots__ = ("lease", "id", "not_after", "command", "joint_positions", "speed_percent", "stop_id", "program")
    class Command(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        COMMAND_UNSPECIFIED: _ClassVar[CommandRequest.Command]
        HOME: _ClassVar[CommandRequest.Command]
        HOLD: _ClassVar[CommandRequest.Command]
        RESUME: _ClassVar[CommandRequest.Command]
        RESET: _ClassVar[CommandRequest.Command]
        TRACE_ON: _ClassVar[CommandRequest.Command]
        TRACE_OFF: _ClassVar[CommandRequest.Command]
        SPEED: _ClassVar[CommandRequest.Command]
        MOVE_ABSOLUTE: _ClassVar[CommandRequest.Command]
        MOVE_RELATIVE: _ClassVar[CommandRequest.Command]
        RUN_PROGRAM: _ClassVar[CommandRequest.Command]
    COMMAND_UNSPECIFIED: CommandRequest.Command
    HOME: CommandRequest.Command
    HOLD: CommandRequest.Command
    RESUME: CommandRequest.Command
    RESET: CommandRequest.Command
    TRACE_ON: CommandRequest.Command
    TRACE_OFF: CommandRequest.Command
    SPEED: CommandRequest.Command
    MOVE_ABSOLUTE: CommandRequest.Command
    MOVE_RELATIVE: CommandRequest.Command
    RUN_PROGRAM: CommandRequest.Command
    LEASE_FIELD_NUMBER: _ClassVar[int]
    ID_FIELD_NUMBER: _ClassVar[int]
    NOT_AFTER_FIELD_NUMBER: _ClassVar[int]
    COMMAND_FIELD_NUMBER: _ClassVar[int]
    JOINT_POSITIONS_FIELD_NUMBER: _ClassVar[int]
    SPEED_PERCENT_FIELD_NUMBER: _ClassVar[int]
    STOP_ID_FIELD_NUMBER: _ClassVar[int]
    PROGRAM_FIELD_NUMBER: _ClassVar[int]
    lease: str
    id: int
    not_after: _timestamp_pb2.Timestamp
    command: CommandRequest.Command
    joint_positions: _containers.RepeatedScalarFieldContainer[float]
    speed_percent: float
    stop_id: int
    program: str
    def __init__(self, lease: _Optional[str] = ..., id: _Optional[int] = ..., not_after: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., command: _Optional[_Union[CommandRequest.Command, str]] = ..., joint_positions: _Optional[_Iterable[float]] = ..., speed_percent: _Optional[float] = ..., stop_id: _Optional[int] = ..., program: _Optional[str] = ...) -> None: ...

class CommandAnswer(_message.Message):
    __slots__ = ("accepted", "text")
    ACCEPTED_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    accepted: bool
    text: str
    def __init__(self, accepted: _Optional[bool] = ..., text: _Optional[str] = ...) -> None: ...

class StopRequest(_message.Message):
    __slots__ = ("reason", "by")
    REASON_FIELD_NUMBER: _ClassVar[int]
    BY_FIELD_NUMBER: _ClassVar[int]
    reason: str
    by: str
    def __init__(self, reason: _Optional[str] = ..., by: _Optional[str] = ...) -> None: ...

class StopAnswer(_message.Message):
    __slots__ = ("stop_id", "sent", "text")
    STOP_ID_FIELD_NUMBER: _ClassVar[int]
    SENT_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    stop_id: int
    sent: bool
    text: str
    def __init__(self, stop_id: _Optional[int] = ..., sent: _Optional[bool] = ..., text: _Optional[str] = ...) -> None: ...

class AuditEntry(_message.Message):
    __slots__ = ("timestamp", "number", "operator", "source", "request", "values", "outcome", "text", "previous", "hash", "repeated_count")
    class Outcome(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        OUTCOME_UNSPECIFIED: _ClassVar[AuditEntry.Outcome]
        ACCEPTED: _ClassVar[AuditEntry.Outcome]
        REFUSED: _ClassVar[AuditEntry.Outcome]
        FAILED: _ClassVar[AuditEntry.Outcome]
    OUTCOME_UNSPECIFIED: AuditEntry.Outcome
    ACCEPTED: AuditEntry.Outcome
    REFUSED: AuditEntry.Outcome
    FAILED: AuditEntry.Outcome
    class ValuesEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: str
        def __init__(self, key: _Optional[str] = ..., value: _Optional[str] = ...) -> None: ...
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    OPERATOR_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    REQUEST_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    OUTCOME_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    PREVIOUS_FIELD_NUMBER: _ClassVar[int]
    HASH_FIELD_NUMBER: _ClassVar[int]
    REPEATED_COUNT_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    number: int
    operator: str
    source: str
    request: str
    values: _containers.ScalarMap[str, str]
    outcome: AuditEntry.Outcome
    text: str
    previous: bytes
    hash: bytes
    repeated_count: int
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., number: _Optional[int] = ..., operator: _Optional[str] = ..., source: _Optional[str] = ..., request: _Optional[str] = ..., values: _Optional[_Mapping[str, str]] = ..., outcome: _Optional[_Union[AuditEntry.Outcome, str]] = ..., text: _Optional[str] = ..., previous: _Optional[bytes] = ..., hash: _Optional[bytes] = ..., repeated_count: _Optional[int] = ...) -> None: ...

class AuditList(_message.Message):
    __slots__ = ("entries",)
    ENTRIES_FIELD_NUMBER: _ClassVar[int]
    entries: _containers.RepeatedCompositeFieldContainer[AuditEntry]
    def __init__(self, entries: _Optional[_Iterable[_Union[AuditEntry, _Mapping]]] = ...) -> None: ...

class Event(_message.Message):
    __slots__ = ("timestamp", "severity", "code", "text", "source", "values")
    class Severity(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        SEVERITY_UNSPECIFIED: _ClassVar[Event.Severity]
        DEBUG: _ClassVar[Event.Severity]
        INFO: _ClassVar[Event.Severity]
        WARNING: _ClassVar[Event.Severity]
        ERROR: _ClassVar[Event.Severity]
        CRITICAL: _ClassVar[Event.Severity]
    SEVERITY_UNSPECIFIED: Event.Severity
    DEBUG: Event.Severity
    INFO: Event.Severity
    WARNING: Event.Severity
    ERROR: Event.Severity
    CRITICAL: Event.Severity
    class ValuesEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: str
        def __init__(self, key: _Optional[str] = ..., value: _Optional[str] = ...) -> None: ...
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SEVERITY_FIELD_NUMBER: _ClassVar[int]
    CODE_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    severity: Event.Severity
    code: str
    text: str
    source: str
    values: _containers.ScalarMap[str, str]
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., severity: _Optional[_Union[Event.Severity, str]] = ..., code: _Optional[str] = ..., text: _Optional[str] = ..., source: _Optional[str] = ..., values: _Optional[_Mapping[str, str]] = ...) -> None: ...

class EventList(_message.Message):
    __slots__ = ("events",)
    EVENTS_FIELD_NUMBER: _ClassVar[int]
    events: _containers.RepeatedCompositeFieldContainer[Event]
    def __init__(self, events: _Optional[_Iterable[_Union[Event, _Mapping]]] = ...) -> None: ...

class Description(_message.Message):
    __slots__ = ("name", "title", "provenance", "robot_toml", "urdf", "joints", "links", "frames", "views", "constraints", "base_to_site", "cell", "simulated")
    class Joint(_message.Message):
        __slots__ = ("name", "type", "lower", "upper", "max_speed", "home", "max_acceleration", "max_jerk")
        class Type(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
            __slots__ = ()
            TYPE_UNSPECIFIED: _ClassVar[Description.Joint.Type]
            ROTARY: _ClassVar[Description.Joint.Type]
            PRISMATIC: _ClassVar[Description.Joint.Type]
        TYPE_UNSPECIFIED: Description.Joint.Type
        ROTARY: Description.Joint.Type
        PRISMATIC: Description.Joint.Type
        NAME_FIELD_NUMBER: _ClassVar[int]
        TYPE_FIELD_NUMBER: _ClassVar[int]
        LOWER_FIELD_NUMBER: _ClassVar[int]
        UPPER_FIELD_NUMBER: _ClassVar[int]
        MAX_SPEED_FIELD_NUMBER: _ClassVar[int]
        HOME_FIELD_NUMBER: _ClassVar[int]
        MAX_ACCELERATION_FIELD_NUMBER: _ClassVar[int]
        MAX_JERK_FIELD_NUMBER: _ClassVar[int]
        name: str
        type: Description.Joint.Type
        lower: float
        upper: float
        max_speed: float
        home: float
        max_acceleration: float
        max_jerk: float
        def __init__(self, name: _Optional[str] = ..., type: _Optional[_Union[Description.Joint.Type, str]] = ..., lower: _Optional[float] = ..., upper: _Optional[float] = ..., max_speed: _Optional[float] = ..., home: _Optional[float] = ..., max_acceleration: _Optional[float] = ..., max_jerk: _Optional[float] = ...) -> None: ...
    class Link(_message.Message):
        __slots__ = ("name", "mesh", "mesh_sha256", "color")
        NAME_FIELD_NUMBER: _ClassVar[int]
        MESH_FIELD_NUMBER: _ClassVar[int]
        MESH_SHA256_FIELD_NUMBER: _ClassVar[int]
        COLOR_FIELD_NUMBER: _ClassVar[int]
        name: str
        mesh: str
        mesh_sha256: str
        color: str
        def __init__(self, name: _Optional[str] = ..., mesh: _Optional[str] = ..., mesh_sha256: _Optional[str] = ..., color: _Optional[str] = ...) -> None: ...
    class NamedFrame(_message.Message):
        __slots__ = ("name", "link", "frame_to_link")
        NAME_FIELD_NUMBER: _ClassVar[int]
        LINK_FIELD_NUMBER: _ClassVar[int]
        FRAME_TO_LINK_FIELD_NUMBER: _ClassVar[int]
        name: str
        link: str
        frame_to_link: _containers.RepeatedScalarFieldContainer[float]
        def __init__(self, name: _Optional[str] = ..., link: _Optional[str] = ..., frame_to_link: _Optional[_Iterable[float]] = ...) -> None: ...
    class Constraint(_message.Message):
        __slots__ = ("joints", "coefficients", "lower", "upper")
        JOINTS_FIELD_NUMBER: _ClassVar[int]
        COEFFICIENTS_FIELD_NUMBER: _ClassVar[int]
        LOWER_FIELD_NUMBER: _ClassVar[int]
        UPPER_FIELD_NUMBER: _ClassVar[int]
        joints: _containers.RepeatedScalarFieldContainer[str]
        coefficients: _containers.RepeatedScalarFieldContainer[float]
        lower: float
        upper: float
        def __init__(self, joints: _Optional[_Iterable[str]] = ..., coefficients: _Optional[_Iterable[float]] = ..., lower: _Optional[float] = ..., upper: _Optional[float] = ...) -> None: ...
    NAME_FIELD_NUMBER: _ClassVar[int]
    TITLE_FIELD_NUMBER: _ClassVar[int]
    PROVENANCE_FIELD_NUMBER: _ClassVar[int]
    ROBOT_TOML_FIELD_NUMBER: _ClassVar[int]
    URDF_FIELD_NUMBER: _ClassVar[int]
    JOINTS_FIELD_NUMBER: _ClassVar[int]
    LINKS_FIELD_NUMBER: _ClassVar[int]
    FRAMES_FIELD_NUMBER: _ClassVar[int]
    VIEWS_FIELD_NUMBER: _ClassVar[int]
    CONSTRAINTS_FIELD_NUMBER: _ClassVar[int]
    BASE_TO_SITE_FIELD_NUMBER: _ClassVar[int]
    CELL_FIELD_NUMBER: _ClassVar[int]
    SIMULATED_FIELD_NUMBER: _ClassVar[int]
    name: str
    title: str
    provenance: str
    robot_toml: str
    urdf: str
    joints: _containers.RepeatedCompositeFieldContainer[Description.Joint]
    links: _containers.RepeatedCompositeFieldContainer[Description.Link]
    frames: _containers.RepeatedCompositeFieldContainer[Description.NamedFrame]
    views: _containers.RepeatedCompositeFieldContainer[View]
    constraints: _containers.RepeatedCompositeFieldContainer[Description.Constraint]
    base_to_site: _containers.RepeatedScalarFieldContainer[float]
    cell: str
    simulated: bool
    def __init__(self, name: _Optional[str] = ..., title: _Optional[str] = ..., provenance: _Optional[str] = ..., robot_toml: _Optional[str] = ..., urdf: _Optional[str] = ..., joints: _Optional[_Iterable[_Union[Description.Joint, _Mapping]]] = ..., links: _Optional[_Iterable[_Union[Description.Link, _Mapping]]] = ..., frames: _Optional[_Iterable[_Union[Description.NamedFrame, _Mapping]]] = ..., views: _Optional[_Iterable[_Union[View, _Mapping]]] = ..., constraints: _Optional[_Iterable[_Union[Description.Constraint, _Mapping]]] = ..., base_to_site: _Optional[_Iterable[float]] = ..., cell: _Optional[str] = ..., simulated: _Optional[bool] = ...) -> None: ...

class View(_message.Message):
    __slots__ = ("name", "eye", "target", "up", "projection")
    class Projection(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        PROJECTION_UNSPECIFIED: _ClassVar[View.Projection]
        PERSPECTIVE: _ClassVar[View.Projection]
        ORTHOGRAPHIC: _ClassVar[View.Projection]
    PROJECTION_UNSPECIFIED: View.Projection
    PERSPECTIVE: View.Projection
    ORTHOGRAPHIC: View.Projection
    NAME_FIELD_NUMBER: _ClassVar[int]
    EYE_FIELD_NUMBER: _ClassVar[int]
    TARGET_FIELD_NUMBER: _ClassVar[int]
    UP_FIELD_NUMBER: _ClassVar[int]
    PROJECTION_FIELD_NUMBER: _ClassVar[int]
    name: str
    eye: Vector3
    target: Vector3
    up: Vector3
    projection: View.Projection
    def __init__(self, name: _Optional[str] = ..., eye: _Optional[_Union[Vector3, _Mapping]] = ..., target: _Optional[_Union[Vector3, _Mapping]] = ..., up: _Optional[_Union[Vector3, _Mapping]] = ..., projection: _Optional[_Union[View.Projection, str]] = ...) -> None: ...

class ForwardRequest(_message.Message):
    __slots__ = ("joint_positions",)
    JOINT_POSITIONS_FIELD_NUMBER: _ClassVar[int]
    joint_positions: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, joint_positions: _Optional[_Iterable[float]] = ...) -> None: ...

class ForwardAnswer(_message.Message):
    __slots__ = ("tool_to_base", "links")
    TOOL_TO_BASE_FIELD_NUMBER: _ClassVar[int]
    LINKS_FIELD_NUMBER: _ClassVar[int]
    tool_to_base: _containers.RepeatedScalarFieldContainer[float]
    links: _containers.RepeatedCompositeFieldContainer[NamedPlacement]
    def __init__(self, tool_to_base: _Optional[_Iterable[float]] = ..., links: _Optional[_Iterable[_Union[NamedPlacement, _Mapping]]] = ...) -> None: ...

class NamedPlacement(_message.Message):
    __slots__ = ("name", "placement_to_base")
    NAME_FIELD_NUMBER: _ClassVar[int]
    PLACEMENT_TO_BASE_FIELD_NUMBER: _ClassVar[int]
    name: str
    placement_to_base: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, name: _Optional[str] = ..., placement_to_base: _Optional[_Iterable[float]] = ...) -> None: ...

class InverseRequest(_message.Message):
    __slots__ = ("pose", "task", "near", "all_solutions", "seed")
    class Task(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        TASK_UNSPECIFIED: _ClassVar[InverseRequest.Task]
        POSE_6D: _ClassVar[InverseRequest.Task]
        POSITION_AND_AXIS_5D: _ClassVar[InverseRequest.Task]
    TASK_UNSPECIFIED: InverseRequest.Task
    POSE_6D: InverseRequest.Task
    POSITION_AND_AXIS_5D: InverseRequest.Task
    POSE_FIELD_NUMBER: _ClassVar[int]
    TASK_FIELD_NUMBER: _ClassVar[int]
    NEAR_FIELD_NUMBER: _ClassVar[int]
    ALL_SOLUTIONS_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    pose: _containers.RepeatedScalarFieldContainer[float]
    task: InverseRequest.Task
    near: _containers.RepeatedScalarFieldContainer[float]
    all_solutions: bool
    seed: int
    def __init__(self, pose: _Optional[_Iterable[float]] = ..., task: _Optional[_Union[InverseRequest.Task, str]] = ..., near: _Optional[_Iterable[float]] = ..., all_solutions: _Optional[bool] = ..., seed: _Optional[int] = ...) -> None: ...

class InverseAnswer(_message.Message):
    __slots__ = ("solutions", "residual_m", "residual_rad", "reason")
    class Solution(_message.Message):
        __slots__ = ("joint_positions",)
        JOINT_POSITIONS_FIELD_NUMBER: _ClassVar[int]
        joint_positions: _containers.RepeatedScalarFieldContainer[float]
        def __init__(self, joint_positions: _Optional[_Iterable[float]] = ...) -> None: ...
    SOLUTIONS_FIELD_NUMBER: _ClassVar[int]
    RESIDUAL_M_FIELD_NUMBER: _ClassVar[int]
    RESIDUAL_RAD_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    solutions: _containers.RepeatedCompositeFieldContainer[InverseAnswer.Solution]
    residual_m: float
    residual_rad: float
    reason: str
    def __init__(self, solutions: _Optional[_Iterable[_Union[InverseAnswer.Solution, _Mapping]]] = ..., residual_m: _Optional[float] = ..., residual_rad: _Optional[float] = ..., reason: _Optional[str] = ...) -> None: ...

class CheckRequest(_message.Message):
    __slots__ = ("program", "start")
    PROGRAM_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    program: str
    start: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, program: _Optional[str] = ..., start: _Optional[_Iterable[float]] = ...) -> None: ...

class CheckAnswer(_message.Message):
    __slots__ = ("ok", "duration_s", "violations")
    class Violation(_message.Message):
        __slots__ = ("line", "time_s", "kind", "pair", "points", "text")
        LINE_FIELD_NUMBER: _ClassVar[int]
        TIME_S_FIELD_NUMBER: _ClassVar[int]
        KIND_FIELD_NUMBER: _ClassVar[int]
        PAIR_FIELD_NUMBER: _ClassVar[int]
        POINTS_FIELD_NUMBER: _ClassVar[int]
        TEXT_FIELD_NUMBER: _ClassVar[int]
        line: int
        time_s: float
        kind: str
        pair: _containers.RepeatedScalarFieldContainer[str]
        points: _containers.RepeatedCompositeFieldContainer[Vector3]
        text: str
        def __init__(self, line: _Optional[int] = ..., time_s: _Optional[float] = ..., kind: _Optional[str] = ..., pair: _Optional[_Iterable[str]] = ..., points: _Optional[_Iterable[_Union[Vector3, _Mapping]]] = ..., text: _Optional[str] = ...) -> None: ...
    OK_FIELD_NUMBER: _ClassVar[int]
    DURATION_S_FIELD_NUMBER: _ClassVar[int]
    VIOLATIONS_FIELD_NUMBER: _ClassVar[int]
    ok: bool
    duration_s: float
    violations: _containers.RepeatedCompositeFieldContainer[CheckAnswer.Violation]
    def __init__(self, ok: _Optional[bool] = ..., duration_s: _Optional[float] = ..., violations: _Optional[_Iterable[_Union[CheckAnswer.Violation, _Mapping]]] = ...) -> None: ...

class VideoFrames(_message.Message):
    __slots__ = ("publisher", "frames")
    class Frame(_message.Message):
        __slots__ = ("sequence", "source_time_ns", "data")
        SEQUENCE_FIELD_NUMBER: _ClassVar[int]
        SOURCE_TIME_NS_FIELD_NUMBER: _ClassVar[int]
        DATA_FIELD_NUMBER: _ClassVar[int]
        sequence: int
        source_time_ns: int
        data: bytes
        def __init__(self, sequence: _Optional[int] = ..., source_time_ns: _Optional[int] = ..., data: _Optional[bytes] = ...) -> None: ...
    PUBLISHER_FIELD_NUMBER: _ClassVar[int]
    FRAMES_FIELD_NUMBER: _ClassVar[int]
    publisher: int
    frames: _containers.RepeatedCompositeFieldContainer[VideoFrames.Frame]
    def __init__(self, publisher: _Optional[int] = ..., frames: _Optional[_Iterable[_Union[VideoFrames.Frame, _Mapping]]] = ...) -> None: ...

class KeyFrameRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class KeyFrameAnswer(_message.Message):
    __slots__ = ("forced",)
    FORCED_FIELD_NUMBER: _ClassVar[int]
    forced: bool
    def __init__(self, forced: _Optional[bool] = ...) -> None: ...

class ViewRequest(_message.Message):
    __slots__ = ("view", "width", "height", "fps")
    VIEW_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    FPS_FIELD_NUMBER: _ClassVar[int]
    view: View
    width: int
    height: int
    fps: float
    def __init__(self, view: _Optional[_Union[View, _Mapping]] = ..., width: _Optional[int] = ..., height: _Optional[int] = ..., fps: _Optional[float] = ...) -> None: ...

class ViewAnswer(_message.Message):
    __slots__ = ("topic",)
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    topic: str
    def __init__(self, topic: _Optional[str] = ...) -> None: ...

class RecorderRequest(_message.Message):
    __slots__ = ("action", "name")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_UNSPECIFIED: _ClassVar[RecorderRequest.Action]
        TRACE_ON: _ClassVar[RecorderRequest.Action]
        TRACE_OFF: _ClassVar[RecorderRequest.Action]
    ACTION_UNSPECIFIED: RecorderRequest.Action
    TRACE_ON: RecorderRequest.Action
    TRACE_OFF: RecorderRequest.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    action: RecorderRequest.Action
    name: str
    def __init__(self, action: _Optional[_Union[RecorderRequest.Action, str]] = ..., name: _Optional[str] = ...) -> None: ...

class Recording(_message.Message):
    __slots__ = ("site", "robot", "name", "file", "start", "duration", "bytes", "open", "topics", "started_by", "problem")
    class TopicCount(_message.Message):
        __slots__ = ("topic", "messages", "lost")
        TOPIC_FIELD_NUMBER: _ClassVar[int]
        MESSAGES_FIELD_NUMBER: _ClassVar[int]
        LOST_FIELD_NUMBER: _ClassVar[int]
        topic: str
        messages: int
        lost: int
        def __init__(self, topic: _Optional[str] = ..., messages: _Optional[int] = ..., lost: _Optional[int] = ...) -> None: ...
    SITE_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    FILE_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    DURATION_FIELD_NUMBER: _ClassVar[int]
    BYTES_FIELD_NUMBER: _ClassVar[int]
    OPEN_FIELD_NUMBER: _ClassVar[int]
    TOPICS_FIELD_NUMBER: _ClassVar[int]
    STARTED_BY_FIELD_NUMBER: _ClassVar[int]
    PROBLEM_FIELD_NUMBER: _ClassVar[int]
    site: str
    robot: str
    name: str
    file: str
    start: _timestamp_pb2.Timestamp
    duration: _duration_pb2.Duration
    bytes: int
    open: bool
    topics: _containers.RepeatedCompositeFieldContainer[Recording.TopicCount]
    started_by: str
    problem: str
    def __init__(self, site: _Optional[str] = ..., robot: _Optional[str] = ..., name: _Optional[str] = ..., file: _Optional[str] = ..., start: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., duration: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., bytes: _Optional[int] = ..., open: _Optional[bool] = ..., topics: _Optional[_Iterable[_Union[Recording.TopicCount, _Mapping]]] = ..., started_by: _Optional[str] = ..., problem: _Optional[str] = ...) -> None: ...

class RecordingList(_message.Message):
    __slots__ = ("recordings",)
    RECORDINGS_FIELD_NUMBER: _ClassVar[int]
    recordings: _containers.RepeatedCompositeFieldContainer[Recording]
    def __init__(self, recordings: _Optional[_Iterable[_Union[Recording, _Mapping]]] = ...) -> None: ...

class ToPage(_message.Message):
    __slots__ = ("sample", "answer", "presence", "hello")
    class Sample(_message.Message):
        __slots__ = ("key", "attachment", "payload", "live", "age_s")
        KEY_FIELD_NUMBER: _ClassVar[int]
        ATTACHMENT_FIELD_NUMBER: _ClassVar[int]
        PAYLOAD_FIELD_NUMBER: _ClassVar[int]
        LIVE_FIELD_NUMBER: _ClassVar[int]
        AGE_S_FIELD_NUMBER: _ClassVar[int]
        key: str
        attachment: bytes
        payload: bytes
        live: bool
        age_s: float
        def __init__(self, key: _Optional[str] = ..., attachment: _Optional[bytes] = ..., payload: _Optional[bytes] = ..., live: _Optional[bool] = ..., age_s: _Optional[float] = ...) -> None: ...
    class Answer(_message.Message):
        __slots__ = ("id", "ok", "payload", "error")
        ID_FIELD_NUMBER: _ClassVar[int]
        OK_FIELD_NUMBER: _ClassVar[int]
        PAYLOAD_FIELD_NUMBER: _ClassVar[int]
        ERROR_FIELD_NUMBER: _ClassVar[int]
        id: int
        ok: bool
        payload: bytes
        error: str
        def __init__(self, id: _Optional[int] = ..., ok: _Optional[bool] = ..., payload: _Optional[bytes] = ..., error: _Optional[str] = ...) -> None: ...
    class Presence(_message.Message):
        __slots__ = ("key", "alive")
        KEY_FIELD_NUMBER: _ClassVar[int]
        ALIVE_FIELD_NUMBER: _ClassVar[int]
        key: str
        alive: bool
        def __init__(self, key: _Optional[str] = ..., alive: _Optional[bool] = ...) -> None: ...
    class Hello(_message.Message):
        __slots__ = ("version", "site", "insecure", "stale", "connected")
        class Stale(_message.Message):
            __slots__ = ("topic", "after_s")
            TOPIC_FIELD_NUMBER: _ClassVar[int]
            AFTER_S_FIELD_NUMBER: _ClassVar[int]
            topic: str
            after_s: float
            def __init__(self, topic: _Optional[str] = ..., after_s: _Optional[float] = ...) -> None: ...
        VERSION_FIELD_NUMBER: _ClassVar[int]
        SITE_FIELD_NUMBER: _ClassVar[int]
        INSECURE_FIELD_NUMBER: _ClassVar[int]
        STALE_FIELD_NUMBER: _ClassVar[int]
        CONNECTED_FIELD_NUMBER: _ClassVar[int]
        version: str
        site: str
        insecure: bool
        stale: _containers.RepeatedCompositeFieldContainer[ToPage.Hello.Stale]
        connected: bool
        def __init__(self, version: _Optional[str] = ..., site: _Optional[str] = ..., insecure: _Optional[bool] = ..., stale: _Optional[_Iterable[_Union[ToPage.Hello.Stale, _Mapping]]] = ..., connected: _Optional[bool] = ...) -> None: ...
    SAMPLE_FIELD_NUMBER: _ClassVar[int]
    ANSWER_FIELD_NUMBER: _ClassVar[int]
    PRESENCE_FIELD_NUMBER: _ClassVar[int]
    HELLO_FIELD_NUMBER: _ClassVar[int]
    sample: ToPage.Sample
    answer: ToPage.Answer
    presence: ToPage.Presence
    hello: ToPage.Hello
    def __init__(self, sample: _Optional[_Union[ToPage.Sample, _Mapping]] = ..., answer: _Optional[_Union[ToPage.Answer, _Mapping]] = ..., presence: _Optional[_Union[ToPage.Presence, _Mapping]] = ..., hello: _Optional[_Union[ToPage.Hello, _Mapping]] = ...) -> None: ...

class FromPage(_message.Message):
    __slots__ = ("ask", "watch", "unwatch")
    class Ask(_message.Message):
        __slots__ = ("id", "key", "payload", "timeout_s")
        ID_FIELD_NUMBER: _ClassVar[int]
        KEY_FIELD_NUMBER: _ClassVar[int]
        PAYLOAD_FIELD_NUMBER: _ClassVar[int]
        TIMEOUT_S_FIELD_NUMBER: _ClassVar[int]
        id: int
        key: str
        payload: bytes
        timeout_s: float
        def __init__(self, id: _Optional[int] = ..., key: _Optional[str] = ..., payload: _Optional[bytes] = ..., timeout_s: _Optional[float] = ...) -> None: ...
    class Watch(_message.Message):
        __slots__ = ("key",)
        KEY_FIELD_NUMBER: _ClassVar[int]
        key: str
        def __init__(self, key: _Optional[str] = ...) -> None: ...
    class Unwatch(_message.Message):
        __slots__ = ("key",)
        KEY_FIELD_NUMBER: _ClassVar[int]
        key: str
        def __init__(self, key: _Optional[str] = ...) -> None: ...
    ASK_FIELD_NUMBER: _ClassVar[int]
    WATCH_FIELD_NUMBER: _ClassVar[int]
    UNWATCH_FIELD_NUMBER: _ClassVar[int]
    ask: FromPage.Ask
    watch: FromPage.Watch
    unwatch: FromPage.Unwatch
    def __init__(self, ask: _Optional[_Union[FromPage.Ask, _Mapping]] = ..., watch: _Optional[_Union[FromPage.Watch, _Mapping]] = ..., unwatch: _Optional[_Union[FromPage.Unwatch, _Mapping]] = ...) -> None: ...
