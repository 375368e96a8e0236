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
    __slots__ = ("timestamp", "link", "mode", "activity", "homed", "trace", "fault", "last_unit_age_s", "controller_time_s", "counters", "read_only", "stop", "link_text", "rate_hz", "health", "audit_head", "legacy_clients", "speed_percent", "check", "check_text", "check_starting", "link_reasons", "check_reason", "program", "jog", "capabilities", "software", "joints_unproven", "joints_sha256")
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
    class Check(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        CHECK_UNSPECIFIED: _ClassVar[ControllerState.Check]
        OFF: _ClassVar[ControllerState.Check]
        WARN: _ClassVar[ControllerState.Check]
        REQUIRE: _ClassVar[ControllerState.Check]
    CHECK_UNSPECIFIED: ControllerState.Check
    OFF: ControllerState.Check
    WARN: ControllerState.Check
    REQUIRE: ControllerState.Check
    class Program(_message.Message):
        __slots__ = ("held", "wait_s")
        HELD_FIELD_NUMBER: _ClassVar[int]
        WAIT_S_FIELD_NUMBER: _ClassVar[int]
        held: bool
        wait_s: float
        def __init__(self, held: _Optional[bool] = ..., wait_s: _Optional[float] = ...) -> None: ...
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
    HEALTH_FIELD_NUMBER: _ClassVar[int]
    AUDIT_HEAD_FIELD_NUMBER: _ClassVar[int]
    LEGACY_CLIENTS_FIELD_NUMBER: _ClassVar[int]
    SPEED_PERCENT_FIELD_NUMBER: _ClassVar[int]
    CHECK_FIELD_NUMBER: _ClassVar[int]
    CHECK_TEXT_FIELD_NUMBER: _ClassVar[int]
    CHECK_STARTING_FIELD_NUMBER: _ClassVar[int]
    LINK_REASONS_FIELD_NUMBER: _ClassVar[int]
    CHECK_REASON_FIELD_NUMBER: _ClassVar[int]
    PROGRAM_FIELD_NUMBER: _ClassVar[int]
    JOG_FIELD_NUMBER: _ClassVar[int]
    CAPABILITIES_FIELD_NUMBER: _ClassVar[int]
    SOFTWARE_FIELD_NUMBER: _ClassVar[int]
    JOINTS_UNPROVEN_FIELD_NUMBER: _ClassVar[int]
    JOINTS_SHA256_FIELD_NUMBER: _ClassVar[int]
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
    health: LinkHealth
    audit_head: AuditHead
    legacy_clients: LegacyClients
    speed_percent: float
    check: ControllerState.Check
    check_text: str
    check_starting: bool
    link_reasons: _containers.RepeatedCompositeFieldContainer[Reason]
    check_reason: Reason
    program: ControllerState.Program
    jog: JogState
    capabilities: Capabilities
    software: str
    joints_unproven: bool
    joints_sha256: str
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., link: _Optional[_Union[ControllerState.Link, str]] = ..., mode: _Optional[_Union[ControllerState.Mode, str]] = ..., activity: _Optional[_Union[ControllerState.Activity, str]] = ..., homed: _Optional[_Union[ControllerState.Known, str]] = ..., trace: _Optional[_Union[ControllerState.Known, str]] = ..., fault: _Optional[str] = ..., last_unit_age_s: _Optional[float] = ..., controller_time_s: _Optional[float] = ..., counters: _Optional[_Union[LinkCounters, _Mapping]] = ..., read_only: _Optional[bool] = ..., stop: _Optional[_Union[StopState, _Mapping]] = ..., link_text: _Optional[str] = ..., rate_hz: _Optional[float] = ..., health: _Optional[_Union[LinkHealth, _Mapping]] = ..., audit_head: _Optional[_Union[AuditHead, _Mapping]] = ..., legacy_clients: _Optional[_Union[LegacyClients, _Mapping]] = ..., speed_percent: _Optional[float] = ..., check: _Optional[_Union[ControllerState.Check, str]] = ..., check_text: _Optional[str] = ..., check_starting: _Optional[bool] = ..., link_reasons: _Optional[_Iterable[_Union[Reason, _Mapping]]] = ..., check_reason: _Optional[_Union[Reason, _Mapping]] = ..., program: _Optional[_Union[ControllerState.Program, _Mapping]] = ..., jog: _Optional[_Union[JogState, _Mapping]] = ..., capabilities: _Optional[_Union[Capabilities, _Mapping]] = ..., software: _Optional[str] = ..., joints_unproven: _Optional[bool] = ..., joints_sha256: _Optional[str] = ...) -> None: ...

class Capabilities(_message.Message):
    __slots__ = ("stops", "commands", "absolute", "dies_with_link", "recoveries", "slow_hz")
    class Stops(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        STOPS_UNSPECIFIED: _ClassVar[Capabilities.Stops]
        NONE: _ClassVar[Capabilities.Stops]
        NOT_NOW: _ClassVar[Capabilities.Stops]
        OURS: _ClassVar[Capabilities.Stops]
        ANY: _ClassVar[Capabilities.Stops]
    STOPS_UNSPECIFIED: Capabilities.Stops
    NONE: Capabilities.Stops
    NOT_NOW: Capabilities.Stops
    OURS: Capabilities.Stops
    ANY: Capabilities.Stops
    STOPS_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_FIELD_NUMBER: _ClassVar[int]
    ABSOLUTE_FIELD_NUMBER: _ClassVar[int]
    DIES_WITH_LINK_FIELD_NUMBER: _ClassVar[int]
    RECOVERIES_FIELD_NUMBER: _ClassVar[int]
    SLOW_HZ_FIELD_NUMBER: _ClassVar[int]
    stops: Capabilities.Stops
    commands: _containers.RepeatedScalarFieldContainer[CommandRequest.Command]
    absolute: bool
    dies_with_link: ControllerState.Known
    recoveries: _containers.RepeatedScalarFieldContainer[Recover.Recovery]
    slow_hz: float
    def __init__(self, stops: _Optional[_Union[Capabilities.Stops, str]] = ..., commands: _Optional[_Iterable[_Union[CommandRequest.Command, str]]] = ..., absolute: _Optional[bool] = ..., dies_with_link: _Optional[_Union[ControllerState.Known, str]] = ..., recoveries: _Optional[_Iterable[_Union[Recover.Recovery, str]]] = ..., slow_hz: _Optional[float] = ...) -> None: ...

class JogState(_message.Message):
    __slots__ = ("operator", "jog")
    OPERATOR_FIELD_NUMBER: _ClassVar[int]
    JOG_FIELD_NUMBER: _ClassVar[int]
    operator: str
    jog: Jog
    def __init__(self, operator: _Optional[str] = ..., jog: _Optional[_Union[Jog, _Mapping]] = ...) -> None: ...

class LinkHealth(_message.Message):
    __slots__ = ("jitter_s", "network_round_trip_s", "answer_s", "flooding", "stamp_uncertainty_s")
    JITTER_S_FIELD_NUMBER: _ClassVar[int]
    NETWORK_ROUND_TRIP_S_FIELD_NUMBER: _ClassVar[int]
    ANSWER_S_FIELD_NUMBER: _ClassVar[int]
    FLOODING_FIELD_NUMBER: _ClassVar[int]
    STAMP_UNCERTAINTY_S_FIELD_NUMBER: _ClassVar[int]
    jitter_s: float
    network_round_trip_s: float
    answer_s: float
    flooding: bool
    stamp_uncertainty_s: float
    def __init__(self, jitter_s: _Optional[float] = ..., network_round_trip_s: _Optional[float] = ..., answer_s: _Optional[float] = ..., flooding: _Optional[bool] = ..., stamp_uncertainty_s: _Optional[float] = ...) -> None: ...

class AuditHead(_message.Message):
    __slots__ = ("number", "hash")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    HASH_FIELD_NUMBER: _ClassVar[int]
    number: int
    hash: bytes
    def __init__(self, number: _Optional[int] = ..., hash: _Optional[bytes] = ...) -> None: ...

class LegacyClients(_message.Message):
    __slots__ = ("attached", "units_refused", "states_skipped", "turned_away", "closed")
    ATTACHED_FIELD_NUMBER: _ClassVar[int]
    UNITS_REFUSED_FIELD_NUMBER: _ClassVar[int]
    STATES_SKIPPED_FIELD_NUMBER: _ClassVar[int]
    TURNED_AWAY_FIELD_NUMBER: _ClassVar[int]
    CLOSED_FIELD_NUMBER: _ClassVar[int]
    attached: int
    units_refused: int
    states_skipped: int
    turned_away: int
    closed: int
    def __init__(self, attached: _Optional[int] = ..., units_refused: _Optional[int] = ..., states_skipped: _Optional[int] = ..., turned_away: _Optional[int] = ..., closed: _Optional[int] = ...) -> None: ...

class LinkCounters(_message.Message):
    __slots__ = ("units_received", "units_malformed", "units_sent", "bytes_received", "bytes_sent", "records_unknown", "connections", "refusals", "units_lost", "units_skipped")
    UNITS_RECEIVED_FIELD_NUMBER: _ClassVar[int]
    UNITS_MALFORMED_FIELD_NUMBER: _ClassVar[int]
    UNITS_SENT_FIELD_NUMBER: _ClassVar[int]
    BYTES_RECEIVED_FIELD_NUMBER: _ClassVar[int]
    BYTES_SENT_FIELD_NUMBER: _ClassVar[int]
    RECORDS_UNKNOWN_FIELD_NUMBER: _ClassVar[int]
    CONNECTIONS_FIELD_NUMBER: _ClassVar[int]
    REFUSALS_FIELD_NUMBER: _ClassVar[int]
    UNITS_LOST_FIELD_NUMBER: _ClassVar[int]
    UNITS_SKIPPED_FIELD_NUMBER: _ClassVar[int]
    units_received: int
    units_malformed: int
    units_sent: int
    bytes_received: int
    bytes_sent: int
    records_unknown: int
    connections: int
    refusals: int
    units_lost: int
    units_skipped: int
    def __init__(self, units_received: _Optional[int] = ..., units_malformed: _Optional[int] = ..., units_sent: _Optional[int] = ..., bytes_received: _Optional[int] = ..., bytes_sent: _Optional[int] = ..., records_unknown: _Optional[int] = ..., connections: _Optional[int] = ..., refusals: _Optional[int] = ..., units_lost: _Optional[int] = ..., units_skipped: _Optional[int] = ...) -> None: ...

class UnitCounts(_message.Message):
    __slots__ = ("timestamp", "received", "malformed", "lost", "skipped", "thinned")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    RECEIVED_FIELD_NUMBER: _ClassVar[int]
    MALFORMED_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    SKIPPED_FIELD_NUMBER: _ClassVar[int]
    THINNED_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    received: int
    malformed: int
    lost: int
    skipped: int
    thinned: int
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., received: _Optional[int] = ..., malformed: _Optional[int] = ..., lost: _Optional[int] = ..., skipped: _Optional[int] = ..., thinned: _Optional[int] = ...) -> None: ...

class StopState(_message.Message):
    __slots__ = ("id", "since", "by", "reason", "sent", "why")
    ID_FIELD_NUMBER: _ClassVar[int]
    SINCE_FIELD_NUMBER: _ClassVar[int]
    BY_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    SENT_FIELD_NUMBER: _ClassVar[int]
    WHY_FIELD_NUMBER: _ClassVar[int]
    id: int
    since: _timestamp_pb2.Timestamp
    by: str
    reason: str
    sent: bool
    why: Reason
    def __init__(self, id: _Optional[int] = ..., since: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., by: _Optional[str] = ..., reason: _Optional[str] = ..., sent: _Optional[bool] = ..., why: _Optional[_Union[Reason, _Mapping]] = ...) -> None: ...

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

class Signals(_message.Message):
    __slots__ = ("timestamp", "signals")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SIGNALS_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    signals: _containers.RepeatedCompositeFieldContainer[Signal]
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., signals: _Optional[_Iterable[_Union[Signal, _Mapping]]] = ...) -> None: ...

class Signal(_message.Message):
    __slots__ = ("name", "unit", "number", "on", "text", "age_s")
    NAME_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    ON_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    AGE_S_FIELD_NUMBER: _ClassVar[int]
    name: str
    unit: str
    number: float
    on: bool
    text: str
    age_s: float
    def __init__(self, name: _Optional[str] = ..., unit: _Optional[str] = ..., number: _Optional[float] = ..., on: _Optional[bool] = ..., text: _Optional[str] = ..., age_s: _Optional[float] = ...) -> None: ...

class KinematicState(_message.Message):
    __slots__ = ("timestamp", "tool_to_base", "linear_velocity", "angular_velocity", "manipulability", "limit_margins", "clearance", "own_clearance", "singularity_margin", "not_counted", "joints_unproven")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    TOOL_TO_BASE_FIELD_NUMBER: _ClassVar[int]
    LINEAR_VELOCITY_FIELD_NUMBER: _ClassVar[int]
    ANGULAR_VELOCITY_FIELD_NUMBER: _ClassVar[int]
    MANIPULABILITY_FIELD_NUMBER: _ClassVar[int]
    LIMIT_MARGINS_FIELD_NUMBER: _ClassVar[int]
    CLEARANCE_FIELD_NUMBER: _ClassVar[int]
    OWN_CLEARANCE_FIELD_NUMBER: _ClassVar[int]
    SINGULARITY_MARGIN_FIELD_NUMBER: _ClassVar[int]
    NOT_COUNTED_FIELD_NUMBER: _ClassVar[int]
    JOINTS_UNPROVEN_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    tool_to_base: _containers.RepeatedScalarFieldContainer[float]
    linear_velocity: Vector3
    angular_velocity: Vector3
    manipulability: float
    limit_margins: _containers.RepeatedCompositeFieldContainer[LimitMargin]
    clearance: Clearance
    own_clearance: Clearance
    singularity_margin: float
    not_counted: _containers.RepeatedScalarFieldContainer[str]
    joints_unproven: bool
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., tool_to_base: _Optional[_Iterable[float]] = ..., linear_velocity: _Optional[_Union[Vector3, _Mapping]] = ..., angular_velocity: _Optional[_Union[Vector3, _Mapping]] = ..., manipulability: _Optional[float] = ..., limit_margins: _Optional[_Iterable[_Union[LimitMargin, _Mapping]]] = ..., clearance: _Optional[_Union[Clearance, _Mapping]] = ..., own_clearance: _Optional[_Union[Clearance, _Mapping]] = ..., singularity_margin: _Optional[float] = ..., not_counted: _Optional[_Iterable[str]] = ..., joints_unproven: _Optional[bool] = ...) -> None: ...

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

class Reason(_message.Message):
    __slots__ = ("code", "values", "causes", "text")
    class ValuesEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: str
        def __init__(self, key: _Optional[str] = ..., value: _Optional[str] = ...) -> None: ...
    CODE_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    CAUSES_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    code: str
    values: _containers.ScalarMap[str, str]
    causes: _containers.RepeatedCompositeFieldContainer[Reason]
    text: str
    def __init__(self, code: _Optional[str] = ..., values: _Optional[_Mapping[str, str]] = ..., causes: _Optional[_Iterable[_Union[Reason, _Mapping]]] = ..., text: _Optional[str] = ...) -> None: ...

class Lease(_message.Message):
    __slots__ = ("timestamp", "holder", "since", "until", "offered_to", "motion", "ended", "asked_by", "ended_reason")
    class Asker(_message.Message):
        __slots__ = ("operator", "reason", "since")
        OPERATOR_FIELD_NUMBER: _ClassVar[int]
        REASON_FIELD_NUMBER: _ClassVar[int]
        SINCE_FIELD_NUMBER: _ClassVar[int]
        operator: str
        reason: str
        since: _timestamp_pb2.Timestamp
        def __init__(self, operator: _Optional[str] = ..., reason: _Optional[str] = ..., since: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    HOLDER_FIELD_NUMBER: _ClassVar[int]
    SINCE_FIELD_NUMBER: _ClassVar[int]
    UNTIL_FIELD_NUMBER: _ClassVar[int]
    OFFERED_TO_FIELD_NUMBER: _ClassVar[int]
    MOTION_FIELD_NUMBER: _ClassVar[int]
    ENDED_FIELD_NUMBER: _ClassVar[int]
    ASKED_BY_FIELD_NUMBER: _ClassVar[int]
    ENDED_REASON_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    holder: str
    since: _timestamp_pb2.Timestamp
    until: _timestamp_pb2.Timestamp
    offered_to: str
    motion: bool
    ended: str
    asked_by: _containers.RepeatedCompositeFieldContainer[Lease.Asker]
    ended_reason: Reason
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., holder: _Optional[str] = ..., since: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., until: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., offered_to: _Optional[str] = ..., motion: _Optional[bool] = ..., ended: _Optional[str] = ..., asked_by: _Optional[_Iterable[_Union[Lease.Asker, _Mapping]]] = ..., ended_reason: _Optional[_Union[Reason, _Mapping]] = ...) -> None: ...

class LeaseRequest(_message.Message):
    __slots__ = ("action", "lease", "ttl_s", "to", "reason", "session", "cause")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_UNSPECIFIED: _ClassVar[LeaseRequest.Action]
        ACQUIRE: _ClassVar[LeaseRequest.Action]
        RENEW: _ClassVar[LeaseRequest.Action]
        RELEASE: _ClassVar[LeaseRequest.Action]
        OFFER: _ClassVar[LeaseRequest.Action]
        ACCEPT: _ClassVar[LeaseRequest.Action]
        TAKE: _ClassVar[LeaseRequest.Action]
        ASK: _ClassVar[LeaseRequest.Action]
    ACTION_UNSPECIFIED: LeaseRequest.Action
    ACQUIRE: LeaseRequest.Action
    RENEW: LeaseRequest.Action
    RELEASE: LeaseRequest.Action
    OFFER: LeaseRequest.Action
    ACCEPT: LeaseRequest.Action
    TAKE: LeaseRequest.Action
    ASK: LeaseRequest.Action
    class Cause(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        CAUSE_UNSPECIFIED: _ClassVar[LeaseRequest.Cause]
        HIDDEN: _ClassVar[LeaseRequest.Cause]
        NO_RIGHT: _ClassVar[LeaseRequest.Cause]
        SIGNED_OUT: _ClassVar[LeaseRequest.Cause]
    CAUSE_UNSPECIFIED: LeaseRequest.Cause
    HIDDEN: LeaseRequest.Cause
    NO_RIGHT: LeaseRequest.Cause
    SIGNED_OUT: LeaseRequest.Cause
    ACTION_FIELD_NUMBER: _ClassVar[int]
    LEASE_FIELD_NUMBER: _ClassVar[int]
    TTL_S_FIELD_NUMBER: _ClassVar[int]
    TO_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    SESSION_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    action: LeaseRequest.Action
    lease: str
    ttl_s: float
    to: str
    reason: str
    session: str
    cause: LeaseRequest.Cause
    def __init__(self, action: _Optional[_Union[LeaseRequest.Action, str]] = ..., lease: _Optional[str] = ..., ttl_s: _Optional[float] = ..., to: _Optional[str] = ..., reason: _Optional[str] = ..., session: _Optional[str] = ..., cause: _Optional[_Union[LeaseRequest.Cause, str]] = ...) -> None: ...

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
    __slots__ = ("lease", "id", "not_after", "command", "joint_positions", "speed_percent", "stop_id", "program", "program_name", "page", "jog", "recover")
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
        JOG: _ClassVar[CommandRequest.Command]
        RECOVER: _ClassVar[CommandRequest.Command]
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
    JOG: CommandRequest.Command
    RECOVER: CommandRequest.Command
    LEASE_FIELD_NUMBER: _ClassVar[int]
    ID_FIELD_NUMBER: _ClassVar[int]
    NOT_AFTER_FIELD_NUMBER: _ClassVar[int]
    COMMAND_FIELD_NUMBER: _ClassVar[int]
    JOINT_POSITIONS_FIELD_NUMBER: _ClassVar[int]
    SPEED_PERCENT_FIELD_NUMBER: _ClassVar[int]
    STOP_ID_FIELD_NUMBER: _ClassVar[int]
    PROGRAM_FIELD_NUMBER: _ClassVar[int]
    PROGRAM_NAME_FIELD_NUMBER: _ClassVar[int]
    PAGE_FIELD_NUMBER: _ClassVar[int]
    JOG_FIELD_NUMBER: _ClassVar[int]
    RECOVER_FIELD_NUMBER: _ClassVar[int]
    lease: str
    id: int
    not_after: _timestamp_pb2.Timestamp
    command: CommandRequest.Command
    joint_positions: _containers.RepeatedScalarFieldContainer[float]
    speed_percent: float
    stop_id: int
    program: str
    program_name: str
    page: PageReport
    jog: Jog
    recover: Recover
    def __init__(self, lease: _Optional[str] = ..., id: _Optional[int] = ..., not_after: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., command: _Optional[_Union[CommandRequest.Command, str]] = ..., joint_positions: _Optional[_Iterable[float]] = ..., speed_percent: _Optional[float] = ..., stop_id: _Optional[int] = ..., program: _Optional[str] = ..., program_name: _Optional[str] = ..., page: _Optional[_Union[PageReport, _Mapping]] = ..., jog: _Optional[_Union[Jog, _Mapping]] = ..., recover: _Optional[_Union[Recover, _Mapping]] = ...) -> None: ...

class Recover(_message.Message):
    __slots__ = ("recovery", "reason", "looked")
    class Recovery(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        RECOVERY_UNSPECIFIED: _ClassVar[Recover.Recovery]
        UNLOCK_PROTECTIVE_STOP: _ClassVar[Recover.Recovery]
        CLOSE_SAFETY_POPUP: _ClassVar[Recover.Recovery]
        RESTART_SAFETY: _ClassVar[Recover.Recovery]
        POWER_ON: _ClassVar[Recover.Recovery]
        BRAKE_RELEASE: _ClassVar[Recover.Recovery]
        SERVO_ON: _ClassVar[Recover.Recovery]
        RESET_ALARM: _ClassVar[Recover.Recovery]
        CONFIRM_TOOL: _ClassVar[Recover.Recovery]
    RECOVERY_UNSPECIFIED: Recover.Recovery
    UNLOCK_PROTECTIVE_STOP: Recover.Recovery
    CLOSE_SAFETY_POPUP: Recover.Recovery
    RESTART_SAFETY: Recover.Recovery
    POWER_ON: Recover.Recovery
    BRAKE_RELEASE: Recover.Recovery
    SERVO_ON: Recover.Recovery
    RESET_ALARM: Recover.Recovery
    CONFIRM_TOOL: Recover.Recovery
    RECOVERY_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    LOOKED_FIELD_NUMBER: _ClassVar[int]
    recovery: Recover.Recovery
    reason: str
    looked: bool
    def __init__(self, recovery: _Optional[_Union[Recover.Recovery, str]] = ..., reason: _Optional[str] = ..., looked: _Optional[bool] = ...) -> None: ...

class Jog(_message.Message):
    __slots__ = ("frame", "axis", "joint", "speed")
    class Frame(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        FRAME_UNSPECIFIED: _ClassVar[Jog.Frame]
        TOOL: _ClassVar[Jog.Frame]
        BASE: _ClassVar[Jog.Frame]
        SITE: _ClassVar[Jog.Frame]
        JOINT: _ClassVar[Jog.Frame]
    FRAME_UNSPECIFIED: Jog.Frame
    TOOL: Jog.Frame
    BASE: Jog.Frame
    SITE: Jog.Frame
    JOINT: Jog.Frame
    class Axis(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        AXIS_UNSPECIFIED: _ClassVar[Jog.Axis]
        X: _ClassVar[Jog.Axis]
        Y: _ClassVar[Jog.Axis]
        Z: _ClassVar[Jog.Axis]
        ROLL: _ClassVar[Jog.Axis]
        PITCH: _ClassVar[Jog.Axis]
        YAW: _ClassVar[Jog.Axis]
    AXIS_UNSPECIFIED: Jog.Axis
    X: Jog.Axis
    Y: Jog.Axis
    Z: Jog.Axis
    ROLL: Jog.Axis
    PITCH: Jog.Axis
    YAW: Jog.Axis
    FRAME_FIELD_NUMBER: _ClassVar[int]
    AXIS_FIELD_NUMBER: _ClassVar[int]
    JOINT_FIELD_NUMBER: _ClassVar[int]
    SPEED_FIELD_NUMBER: _ClassVar[int]
    frame: Jog.Frame
    axis: Jog.Axis
    joint: int
    speed: float
    def __init__(self, frame: _Optional[_Union[Jog.Frame, str]] = ..., axis: _Optional[_Union[Jog.Axis, str]] = ..., joint: _Optional[int] = ..., speed: _Optional[float] = ...) -> None: ...

class JogRequest(_message.Message):
    __slots__ = ("lease", "jog", "sequence", "release")
    LEASE_FIELD_NUMBER: _ClassVar[int]
    JOG_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    RELEASE_FIELD_NUMBER: _ClassVar[int]
    lease: str
    jog: int
    sequence: int
    release: bool
    def __init__(self, lease: _Optional[str] = ..., jog: _Optional[int] = ..., sequence: _Optional[int] = ..., release: _Optional[bool] = ...) -> None: ...

class JogAnswer(_message.Message):
    __slots__ = ("running", "moved", "rotary", "text", "reason")
    RUNNING_FIELD_NUMBER: _ClassVar[int]
    MOVED_FIELD_NUMBER: _ClassVar[int]
    ROTARY_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    running: bool
    moved: float
    rotary: bool
    text: str
    reason: Reason
    def __init__(self, running: _Optional[bool] = ..., moved: _Optional[float] = ..., rotary: _Optional[bool] = ..., text: _Optional[str] = ..., reason: _Optional[_Union[Reason, _Mapping]] = ...) -> None: ...

class PageReport(_message.Message):
    __slots__ = ("view", "picture", "picture_time", "picture_age_s", "state_age_s")
    VIEW_FIELD_NUMBER: _ClassVar[int]
    PICTURE_FIELD_NUMBER: _ClassVar[int]
    PICTURE_TIME_FIELD_NUMBER: _ClassVar[int]
    PICTURE_AGE_S_FIELD_NUMBER: _ClassVar[int]
    STATE_AGE_S_FIELD_NUMBER: _ClassVar[int]
    view: str
    picture: int
    picture_time: _timestamp_pb2.Timestamp
    picture_age_s: float
    state_age_s: float
    def __init__(self, view: _Optional[str] = ..., picture: _Optional[int] = ..., picture_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., picture_age_s: _Optional[float] = ..., state_age_s: _Optional[float] = ...) -> None: ...

class ProgramState(_message.Message):
    __slots__ = ("timestamp", "outcome", "name", "operator", "since", "line", "statement", "step", "steps", "duration_s", "text", "reason", "left_s")
    class Outcome(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        OUTCOME_UNSPECIFIED: _ClassVar[ProgramState.Outcome]
        RUNNING: _ClassVar[ProgramState.Outcome]
        DONE: _ClassVar[ProgramState.Outcome]
        ENDED: _ClassVar[ProgramState.Outcome]
    OUTCOME_UNSPECIFIED: ProgramState.Outcome
    RUNNING: ProgramState.Outcome
    DONE: ProgramState.Outcome
    ENDED: ProgramState.Outcome
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    OUTCOME_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    OPERATOR_FIELD_NUMBER: _ClassVar[int]
    SINCE_FIELD_NUMBER: _ClassVar[int]
    LINE_FIELD_NUMBER: _ClassVar[int]
    STATEMENT_FIELD_NUMBER: _ClassVar[int]
    STEP_FIELD_NUMBER: _ClassVar[int]
    STEPS_FIELD_NUMBER: _ClassVar[int]
    DURATION_S_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    LEFT_S_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    outcome: ProgramState.Outcome
    name: str
    operator: str
    since: _timestamp_pb2.Timestamp
    line: int
    statement: str
    step: int
    steps: int
    duration_s: float
    text: str
    reason: Reason
    left_s: float
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., outcome: _Optional[_Union[ProgramState.Outcome, str]] = ..., name: _Optional[str] = ..., operator: _Optional[str] = ..., since: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., line: _Optional[int] = ..., statement: _Optional[str] = ..., step: _Optional[int] = ..., steps: _Optional[int] = ..., duration_s: _Optional[float] = ..., text: _Optional[str] = ..., reason: _Optional[_Union[Reason, _Mapping]] = ..., left_s: _Optional[float] = ...) -> None: ...

class ProgramSource(_message.Message):
    __slots__ = ("timestamp", "name", "operator", "text")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    OPERATOR_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    name: str
    operator: str
    text: str
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., name: _Optional[str] = ..., operator: _Optional[str] = ..., text: _Optional[str] = ...) -> None: ...

class CommandAnswer(_message.Message):
    __slots__ = ("accepted", "text", "warning")
    ACCEPTED_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    WARNING_FIELD_NUMBER: _ClassVar[int]
    accepted: bool
    text: str
    warning: Reason
    def __init__(self, accepted: _Optional[bool] = ..., text: _Optional[str] = ..., warning: _Optional[_Union[Reason, _Mapping]] = ...) -> None: ...

class StopRequest(_message.Message):
    __slots__ = ("reason", "by", "page")
    REASON_FIELD_NUMBER: _ClassVar[int]
    BY_FIELD_NUMBER: _ClassVar[int]
    PAGE_FIELD_NUMBER: _ClassVar[int]
    reason: str
    by: str
    page: PageReport
    def __init__(self, reason: _Optional[str] = ..., by: _Optional[str] = ..., page: _Optional[_Union[PageReport, _Mapping]] = ...) -> None: ...

class StopAnswer(_message.Message):
    __slots__ = ("stop_id", "sent", "text", "reason")
    STOP_ID_FIELD_NUMBER: _ClassVar[int]
    SENT_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    stop_id: int
    sent: bool
    text: str
    reason: Reason
    def __init__(self, stop_id: _Optional[int] = ..., sent: _Optional[bool] = ..., text: _Optional[str] = ..., reason: _Optional[_Union[Reason, _Mapping]] = ...) -> None: ...

class AuditEntry(_message.Message):
    __slots__ = ("timestamp", "number", "operator", "source", "request", "values", "outcome", "text", "previous", "hash", "repeated_count", "reason")
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
    REASON_FIELD_NUMBER: _ClassVar[int]
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
    reason: Reason
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., number: _Optional[int] = ..., operator: _Optional[str] = ..., source: _Optional[str] = ..., request: _Optional[str] = ..., values: _Optional[_Mapping[str, str]] = ..., outcome: _Optional[_Union[AuditEntry.Outcome, str]] = ..., text: _Optional[str] = ..., previous: _Optional[bytes] = ..., hash: _Optional[bytes] = ..., repeated_count: _Optional[int] = ..., reason: _Optional[_Union[Reason, _Mapping]] = ...) -> None: ...

class AuditList(_message.Message):
    __slots__ = ("entries",)
    ENTRIES_FIELD_NUMBER: _ClassVar[int]
    entries: _containers.RepeatedCompositeFieldContainer[AuditEntry]
    def __init__(self, entries: _Optional[_Iterable[_Union[AuditEntry, _Mapping]]] = ...) -> None: ...

class AuditQuery(_message.Message):
    __slots__ = ("operator", "request", "outcome", "since", "until", "most")
    OPERATOR_FIELD_NUMBER: _ClassVar[int]
    REQUEST_FIELD_NUMBER: _ClassVar[int]
    OUTCOME_FIELD_NUMBER: _ClassVar[int]
    SINCE_FIELD_NUMBER: _ClassVar[int]
    UNTIL_FIELD_NUMBER: _ClassVar[int]
    MOST_FIELD_NUMBER: _ClassVar[int]
    operator: str
    request: str
    outcome: AuditEntry.Outcome
    since: _timestamp_pb2.Timestamp
    until: _timestamp_pb2.Timestamp
    most: int
    def __init__(self, operator: _Optional[str] = ..., request: _Optional[str] = ..., outcome: _Optional[_Union[AuditEntry.Outcome, str]] = ..., since: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., until: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., most: _Optional[int] = ...) -> None: ...

class Event(_message.Message):
    __slots__ = ("timestamp", "severity", "code", "text", "source", "values", "reason", "note")
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
    REASON_FIELD_NUMBER: _ClassVar[int]
    NOTE_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    severity: Event.Severity
    code: str
    text: str
    source: str
    values: _containers.ScalarMap[str, str]
    reason: Reason
    note: Note
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., severity: _Optional[_Union[Event.Severity, str]] = ..., code: _Optional[str] = ..., text: _Optional[str] = ..., source: _Optional[str] = ..., values: _Optional[_Mapping[str, str]] = ..., reason: _Optional[_Union[Reason, _Mapping]] = ..., note: _Optional[_Union[Note, _Mapping]] = ...) -> None: ...

class EventList(_message.Message):
    __slots__ = ("events",)
    EVENTS_FIELD_NUMBER: _ClassVar[int]
    events: _containers.RepeatedCompositeFieldContainer[Event]
    def __init__(self, events: _Optional[_Iterable[_Union[Event, _Mapping]]] = ...) -> None: ...

class Note(_message.Message):
    __slots__ = ("id", "begin", "end", "author", "text")
    ID_FIELD_NUMBER: _ClassVar[int]
    BEGIN_FIELD_NUMBER: _ClassVar[int]
    END_FIELD_NUMBER: _ClassVar[int]
    AUTHOR_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    id: str
    begin: _timestamp_pb2.Timestamp
    end: _timestamp_pb2.Timestamp
    author: str
    text: str
    def __init__(self, id: _Optional[str] = ..., begin: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., end: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., author: _Optional[str] = ..., text: _Optional[str] = ...) -> None: ...

class NoteRequest(_message.Message):
    __slots__ = ("action", "robot", "id", "text", "begin", "end")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_UNSPECIFIED: _ClassVar[NoteRequest.Action]
        WRITE: _ClassVar[NoteRequest.Action]
        WITHDRAW: _ClassVar[NoteRequest.Action]
    ACTION_UNSPECIFIED: NoteRequest.Action
    WRITE: NoteRequest.Action
    WITHDRAW: NoteRequest.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    ID_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    BEGIN_FIELD_NUMBER: _ClassVar[int]
    END_FIELD_NUMBER: _ClassVar[int]
    action: NoteRequest.Action
    robot: str
    id: str
    text: str
    begin: _timestamp_pb2.Timestamp
    end: _timestamp_pb2.Timestamp
    def __init__(self, action: _Optional[_Union[NoteRequest.Action, str]] = ..., robot: _Optional[str] = ..., id: _Optional[str] = ..., text: _Optional[str] = ..., begin: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., end: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...

class NoteQuery(_message.Message):
    __slots__ = ("robot", "since", "until", "most")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    SINCE_FIELD_NUMBER: _ClassVar[int]
    UNTIL_FIELD_NUMBER: _ClassVar[int]
    MOST_FIELD_NUMBER: _ClassVar[int]
    robot: str
    since: _timestamp_pb2.Timestamp
    until: _timestamp_pb2.Timestamp
    most: int
    def __init__(self, robot: _Optional[str] = ..., since: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., until: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., most: _Optional[int] = ...) -> None: ...

class Description(_message.Message):
    __slots__ = ("name", "title", "provenance", "robot_toml", "urdf", "joints", "links", "frames", "views", "constraints", "base_to_site", "cell", "simulated", "fixtures", "warning_distance", "stop_distance", "replay", "stale_after_s", "title_zh", "provenance_zh", "floor", "cell_version")
    class Floor(_message.Message):
        __slots__ = ("height", "warning_distance", "stop_distance")
        HEIGHT_FIELD_NUMBER: _ClassVar[int]
        WARNING_DISTANCE_FIELD_NUMBER: _ClassVar[int]
        STOP_DISTANCE_FIELD_NUMBER: _ClassVar[int]
        height: float
        warning_distance: float
        stop_distance: float
        def __init__(self, height: _Optional[float] = ..., warning_distance: _Optional[float] = ..., stop_distance: _Optional[float] = ...) -> None: ...
    class Replay(_message.Message):
        __slots__ = ("id", "site", "robot", "file", "start")
        ID_FIELD_NUMBER: _ClassVar[int]
        SITE_FIELD_NUMBER: _ClassVar[int]
        ROBOT_FIELD_NUMBER: _ClassVar[int]
        FILE_FIELD_NUMBER: _ClassVar[int]
        START_FIELD_NUMBER: _ClassVar[int]
        id: str
        site: str
        robot: str
        file: str
        start: _timestamp_pb2.Timestamp
        def __init__(self, id: _Optional[str] = ..., site: _Optional[str] = ..., robot: _Optional[str] = ..., file: _Optional[str] = ..., start: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...
    class Joint(_message.Message):
        __slots__ = ("name", "type", "lower", "upper", "max_speed", "home", "max_acceleration", "max_jerk", "title", "title_zh")
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
        TITLE_FIELD_NUMBER: _ClassVar[int]
        TITLE_ZH_FIELD_NUMBER: _ClassVar[int]
        name: str
        type: Description.Joint.Type
        lower: float
        upper: float
        max_speed: float
        home: float
        max_acceleration: float
        max_jerk: float
        title: str
        title_zh: str
        def __init__(self, name: _Optional[str] = ..., type: _Optional[_Union[Description.Joint.Type, str]] = ..., lower: _Optional[float] = ..., upper: _Optional[float] = ..., max_speed: _Optional[float] = ..., home: _Optional[float] = ..., max_acceleration: _Optional[float] = ..., max_jerk: _Optional[float] = ..., title: _Optional[str] = ..., title_zh: _Optional[str] = ...) -> None: ...
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
    class Fixture(_message.Message):
        __slots__ = ("name", "mesh", "mesh_sha256", "fixture_to_site", "color")
        NAME_FIELD_NUMBER: _ClassVar[int]
        MESH_FIELD_NUMBER: _ClassVar[int]
        MESH_SHA256_FIELD_NUMBER: _ClassVar[int]
        FIXTURE_TO_SITE_FIELD_NUMBER: _ClassVar[int]
        COLOR_FIELD_NUMBER: _ClassVar[int]
        name: str
        mesh: str
        mesh_sha256: str
        fixture_to_site: _containers.RepeatedScalarFieldContainer[float]
        color: str
        def __init__(self, name: _Optional[str] = ..., mesh: _Optional[str] = ..., mesh_sha256: _Optional[str] = ..., fixture_to_site: _Optional[_Iterable[float]] = ..., color: _Optional[str] = ...) -> None: ...
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
    FIXTURES_FIELD_NUMBER: _ClassVar[int]
    WARNING_DISTANCE_FIELD_NUMBER: _ClassVar[int]
    STOP_DISTANCE_FIELD_NUMBER: _ClassVar[int]
    REPLAY_FIELD_NUMBER: _ClassVar[int]
    STALE_AFTER_S_FIELD_NUMBER: _ClassVar[int]
    TITLE_ZH_FIELD_NUMBER: _ClassVar[int]
    PROVENANCE_ZH_FIELD_NUMBER: _ClassVar[int]
    FLOOR_FIELD_NUMBER: _ClassVar[int]
    CELL_VERSION_FIELD_NUMBER: _ClassVar[int]
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
    fixtures: _containers.RepeatedCompositeFieldContainer[Description.Fixture]
    warning_distance: float
    stop_distance: float
    replay: Description.Replay
    stale_after_s: float
    title_zh: str
    provenance_zh: str
    floor: Description.Floor
    cell_version: str
    def __init__(self, name: _Optional[str] = ..., title: _Optional[str] = ..., provenance: _Optional[str] = ..., robot_toml: _Optional[str] = ..., urdf: _Optional[str] = ..., joints: _Optional[_Iterable[_Union[Description.Joint, _Mapping]]] = ..., links: _Optional[_Iterable[_Union[Description.Link, _Mapping]]] = ..., frames: _Optional[_Iterable[_Union[Description.NamedFrame, _Mapping]]] = ..., views: _Optional[_Iterable[_Union[View, _Mapping]]] = ..., constraints: _Optional[_Iterable[_Union[Description.Constraint, _Mapping]]] = ..., base_to_site: _Optional[_Iterable[float]] = ..., cell: _Optional[str] = ..., simulated: _Optional[bool] = ..., fixtures: _Optional[_Iterable[_Union[Description.Fixture, _Mapping]]] = ..., warning_distance: _Optional[float] = ..., stop_distance: _Optional[float] = ..., replay: _Optional[_Union[Description.Replay, _Mapping]] = ..., stale_after_s: _Optional[float] = ..., title_zh: _Optional[str] = ..., provenance_zh: _Optional[str] = ..., floor: _Optional[_Union[Description.Floor, _Mapping]] = ..., cell_version: _Optional[str] = ...) -> None: ...

class View(_message.Message):
    __slots__ = ("name", "eye", "target", "up", "projection", "mount", "field_of_view", "height")
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
    MOUNT_FIELD_NUMBER: _ClassVar[int]
    FIELD_OF_VIEW_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    name: str
    eye: Vector3
    target: Vector3
    up: Vector3
    projection: View.Projection
    mount: str
    field_of_view: float
    height: float
    def __init__(self, name: _Optional[str] = ..., eye: _Optional[_Union[Vector3, _Mapping]] = ..., target: _Optional[_Union[Vector3, _Mapping]] = ..., up: _Optional[_Union[Vector3, _Mapping]] = ..., projection: _Optional[_Union[View.Projection, str]] = ..., mount: _Optional[str] = ..., field_of_view: _Optional[float] = ..., height: _Optional[float] = ...) -> None: ...

class FaultRequest(_message.Message):
    __slots__ = ("fault", "off")
    FAULT_FIELD_NUMBER: _ClassVar[int]
    OFF_FIELD_NUMBER: _ClassVar[int]
    fault: str
    off: bool
    def __init__(self, fault: _Optional[str] = ..., off: _Optional[bool] = ...) -> None: ...

class FaultAnswer(_message.Message):
    __slots__ = ("active", "known")
    ACTIVE_FIELD_NUMBER: _ClassVar[int]
    KNOWN_FIELD_NUMBER: _ClassVar[int]
    active: _containers.RepeatedScalarFieldContainer[str]
    known: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, active: _Optional[_Iterable[str]] = ..., known: _Optional[_Iterable[str]] = ...) -> None: ...

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
    __slots__ = ("solutions", "residual_m", "residual_rad", "reason", "analytic", "cause")
    class Solution(_message.Message):
        __slots__ = ("joint_positions",)
        JOINT_POSITIONS_FIELD_NUMBER: _ClassVar[int]
        joint_positions: _containers.RepeatedScalarFieldContainer[float]
        def __init__(self, joint_positions: _Optional[_Iterable[float]] = ...) -> None: ...
    SOLUTIONS_FIELD_NUMBER: _ClassVar[int]
    RESIDUAL_M_FIELD_NUMBER: _ClassVar[int]
    RESIDUAL_RAD_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    ANALYTIC_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    solutions: _containers.RepeatedCompositeFieldContainer[InverseAnswer.Solution]
    residual_m: float
    residual_rad: float
    reason: str
    analytic: bool
    cause: Reason
    def __init__(self, solutions: _Optional[_Iterable[_Union[InverseAnswer.Solution, _Mapping]]] = ..., residual_m: _Optional[float] = ..., residual_rad: _Optional[float] = ..., reason: _Optional[str] = ..., analytic: _Optional[bool] = ..., cause: _Optional[_Union[Reason, _Mapping]] = ...) -> None: ...

class CheckRequest(_message.Message):
    __slots__ = ("program", "start", "exact", "path")
    PROGRAM_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    EXACT_FIELD_NUMBER: _ClassVar[int]
    PATH_FIELD_NUMBER: _ClassVar[int]
    program: str
    start: _containers.RepeatedScalarFieldContainer[float]
    exact: bool
    path: bool
    def __init__(self, program: _Optional[str] = ..., start: _Optional[_Iterable[float]] = ..., exact: _Optional[bool] = ..., path: _Optional[bool] = ...) -> None: ...

class CheckAnswer(_message.Message):
    __slots__ = ("ok", "duration_s", "violations", "interpolation", "notes", "path", "note_reasons", "interpolation_reason", "alone")
    class Violation(_message.Message):
        __slots__ = ("line", "time_s", "kind", "pair", "points", "text", "until_s", "distance", "refuses", "reason")
        LINE_FIELD_NUMBER: _ClassVar[int]
        TIME_S_FIELD_NUMBER: _ClassVar[int]
        KIND_FIELD_NUMBER: _ClassVar[int]
        PAIR_FIELD_NUMBER: _ClassVar[int]
        POINTS_FIELD_NUMBER: _ClassVar[int]
        TEXT_FIELD_NUMBER: _ClassVar[int]
        UNTIL_S_FIELD_NUMBER: _ClassVar[int]
        DISTANCE_FIELD_NUMBER: _ClassVar[int]
        REFUSES_FIELD_NUMBER: _ClassVar[int]
        REASON_FIELD_NUMBER: _ClassVar[int]
        line: int
        time_s: float
        kind: str
        pair: _containers.RepeatedScalarFieldContainer[str]
        points: _containers.RepeatedCompositeFieldContainer[Vector3]
        text: str
        until_s: float
        distance: float
        refuses: bool
        reason: Reason
        def __init__(self, line: _Optional[int] = ..., time_s: _Optional[float] = ..., kind: _Optional[str] = ..., pair: _Optional[_Iterable[str]] = ..., points: _Optional[_Iterable[_Union[Vector3, _Mapping]]] = ..., text: _Optional[str] = ..., until_s: _Optional[float] = ..., distance: _Optional[float] = ..., refuses: _Optional[bool] = ..., reason: _Optional[_Union[Reason, _Mapping]] = ...) -> None: ...
    class Path(_message.Message):
        __slots__ = ("times_s", "joint_positions", "tool_positions", "clearances", "lines")
        TIMES_S_FIELD_NUMBER: _ClassVar[int]
        JOINT_POSITIONS_FIELD_NUMBER: _ClassVar[int]
        TOOL_POSITIONS_FIELD_NUMBER: _ClassVar[int]
        CLEARANCES_FIELD_NUMBER: _ClassVar[int]
        LINES_FIELD_NUMBER: _ClassVar[int]
        times_s: _containers.RepeatedScalarFieldContainer[float]
        joint_positions: _containers.RepeatedScalarFieldContainer[float]
        tool_positions: _containers.RepeatedScalarFieldContainer[float]
        clearances: _containers.RepeatedScalarFieldContainer[float]
        lines: _containers.RepeatedScalarFieldContainer[int]
        def __init__(self, times_s: _Optional[_Iterable[float]] = ..., joint_positions: _Optional[_Iterable[float]] = ..., tool_positions: _Optional[_Iterable[float]] = ..., clearances: _Optional[_Iterable[float]] = ..., lines: _Optional[_Iterable[int]] = ...) -> None: ...
    OK_FIELD_NUMBER: _ClassVar[int]
    DURATION_S_FIELD_NUMBER: _ClassVar[int]
    VIOLATIONS_FIELD_NUMBER: _ClassVar[int]
    INTERPOLATION_FIELD_NUMBER: _ClassVar[int]
    NOTES_FIELD_NUMBER: _ClassVar[int]
    PATH_FIELD_NUMBER: _ClassVar[int]
    NOTE_REASONS_FIELD_NUMBER: _ClassVar[int]
    INTERPOLATION_REASON_FIELD_NUMBER: _ClassVar[int]
    ALONE_FIELD_NUMBER: _ClassVar[int]
    ok: bool
    duration_s: float
    violations: _containers.RepeatedCompositeFieldContainer[CheckAnswer.Violation]
    interpolation: str
    notes: _containers.RepeatedScalarFieldContainer[str]
    path: CheckAnswer.Path
    note_reasons: _containers.RepeatedCompositeFieldContainer[Reason]
    interpolation_reason: Reason
    alone: bool
    def __init__(self, ok: _Optional[bool] = ..., duration_s: _Optional[float] = ..., violations: _Optional[_Iterable[_Union[CheckAnswer.Violation, _Mapping]]] = ..., interpolation: _Optional[str] = ..., notes: _Optional[_Iterable[str]] = ..., path: _Optional[_Union[CheckAnswer.Path, _Mapping]] = ..., note_reasons: _Optional[_Iterable[_Union[Reason, _Mapping]]] = ..., interpolation_reason: _Optional[_Union[Reason, _Mapping]] = ..., alone: _Optional[bool] = ...) -> None: ...

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
    __slots__ = ("view", "width", "height", "fps", "of", "most_bits_per_s", "show")
    class Show(_message.Message):
        __slots__ = ("trail", "frames", "no_text", "ghost", "path")
        TRAIL_FIELD_NUMBER: _ClassVar[int]
        FRAMES_FIELD_NUMBER: _ClassVar[int]
        NO_TEXT_FIELD_NUMBER: _ClassVar[int]
        GHOST_FIELD_NUMBER: _ClassVar[int]
        PATH_FIELD_NUMBER: _ClassVar[int]
        trail: bool
        frames: bool
        no_text: bool
        ghost: _containers.RepeatedScalarFieldContainer[float]
        path: _containers.RepeatedCompositeFieldContainer[Vector3]
        def __init__(self, trail: _Optional[bool] = ..., frames: _Optional[bool] = ..., no_text: _Optional[bool] = ..., ghost: _Optional[_Iterable[float]] = ..., path: _Optional[_Iterable[_Union[Vector3, _Mapping]]] = ...) -> None: ...
    VIEW_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    FPS_FIELD_NUMBER: _ClassVar[int]
    OF_FIELD_NUMBER: _ClassVar[int]
    MOST_BITS_PER_S_FIELD_NUMBER: _ClassVar[int]
    SHOW_FIELD_NUMBER: _ClassVar[int]
    view: View
    width: int
    height: int
    fps: float
    of: str
    most_bits_per_s: float
    show: ViewRequest.Show
    def __init__(self, view: _Optional[_Union[View, _Mapping]] = ..., width: _Optional[int] = ..., height: _Optional[int] = ..., fps: _Optional[float] = ..., of: _Optional[str] = ..., most_bits_per_s: _Optional[float] = ..., show: _Optional[_Union[ViewRequest.Show, _Mapping]] = ...) -> None: ...

class ViewAnswer(_message.Message):
    __slots__ = ("topic", "image", "width", "height", "fps")
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    IMAGE_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    FPS_FIELD_NUMBER: _ClassVar[int]
    topic: str
    image: str
    width: int
    height: int
    fps: float
    def __init__(self, topic: _Optional[str] = ..., image: _Optional[str] = ..., width: _Optional[int] = ..., height: _Optional[int] = ..., fps: _Optional[float] = ...) -> None: ...

class RecorderRequest(_message.Message):
    __slots__ = ("action", "name", "views")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_UNSPECIFIED: _ClassVar[RecorderRequest.Action]
        TRACE_ON: _ClassVar[RecorderRequest.Action]
        TRACE_OFF: _ClassVar[RecorderRequest.Action]
        SAVE: _ClassVar[RecorderRequest.Action]
    ACTION_UNSPECIFIED: RecorderRequest.Action
    TRACE_ON: RecorderRequest.Action
    TRACE_OFF: RecorderRequest.Action
    SAVE: RecorderRequest.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    VIEWS_FIELD_NUMBER: _ClassVar[int]
    action: RecorderRequest.Action
    name: str
    views: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, action: _Optional[_Union[RecorderRequest.Action, str]] = ..., name: _Optional[str] = ..., views: _Optional[_Iterable[str]] = ...) -> None: ...

class Recording(_message.Message):
    __slots__ = ("site", "robot", "name", "file", "start", "duration", "bytes", "open", "topics", "started_by", "problem", "audit_head", "cause", "part", "attachments", "recovered", "indexing", "problem_reason", "merged_from", "note", "tags", "changes", "history", "deleted")
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
    AUDIT_HEAD_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    PART_FIELD_NUMBER: _ClassVar[int]
    ATTACHMENTS_FIELD_NUMBER: _ClassVar[int]
    RECOVERED_FIELD_NUMBER: _ClassVar[int]
    INDEXING_FIELD_NUMBER: _ClassVar[int]
    PROBLEM_REASON_FIELD_NUMBER: _ClassVar[int]
    MERGED_FROM_FIELD_NUMBER: _ClassVar[int]
    NOTE_FIELD_NUMBER: _ClassVar[int]
    TAGS_FIELD_NUMBER: _ClassVar[int]
    CHANGES_FIELD_NUMBER: _ClassVar[int]
    HISTORY_FIELD_NUMBER: _ClassVar[int]
    DELETED_FIELD_NUMBER: _ClassVar[int]
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
    audit_head: AuditHead
    cause: str
    part: int
    attachments: _containers.RepeatedScalarFieldContainer[str]
    recovered: bool
    indexing: float
    problem_reason: Reason
    merged_from: _containers.RepeatedCompositeFieldContainer[Recording]
    note: str
    tags: _containers.RepeatedScalarFieldContainer[str]
    changes: int
    history: _containers.RepeatedCompositeFieldContainer[RecordingChange]
    deleted: bool
    def __init__(self, site: _Optional[str] = ..., robot: _Optional[str] = ..., name: _Optional[str] = ..., file: _Optional[str] = ..., start: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., duration: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., bytes: _Optional[int] = ..., open: _Optional[bool] = ..., topics: _Optional[_Iterable[_Union[Recording.TopicCount, _Mapping]]] = ..., started_by: _Optional[str] = ..., problem: _Optional[str] = ..., audit_head: _Optional[_Union[AuditHead, _Mapping]] = ..., cause: _Optional[str] = ..., part: _Optional[int] = ..., attachments: _Optional[_Iterable[str]] = ..., recovered: _Optional[bool] = ..., indexing: _Optional[float] = ..., problem_reason: _Optional[_Union[Reason, _Mapping]] = ..., merged_from: _Optional[_Iterable[_Union[Recording, _Mapping]]] = ..., note: _Optional[str] = ..., tags: _Optional[_Iterable[str]] = ..., changes: _Optional[int] = ..., history: _Optional[_Iterable[_Union[RecordingChange, _Mapping]]] = ..., deleted: _Optional[bool] = ...) -> None: ...

class RecordingChange(_message.Message):
    __slots__ = ("number", "change", "timestamp", "author", "name", "note", "tags", "reason", "sha256", "bytes")
    class Change(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        CHANGE_UNSPECIFIED: _ClassVar[RecordingChange.Change]
        RENAMED: _ClassVar[RecordingChange.Change]
        NOTED: _ClassVar[RecordingChange.Change]
        TAGGED: _ClassVar[RecordingChange.Change]
        DELETED: _ClassVar[RecordingChange.Change]
    CHANGE_UNSPECIFIED: RecordingChange.Change
    RENAMED: RecordingChange.Change
    NOTED: RecordingChange.Change
    TAGGED: RecordingChange.Change
    DELETED: RecordingChange.Change
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    CHANGE_FIELD_NUMBER: _ClassVar[int]
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    AUTHOR_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    NOTE_FIELD_NUMBER: _ClassVar[int]
    TAGS_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    SHA256_FIELD_NUMBER: _ClassVar[int]
    BYTES_FIELD_NUMBER: _ClassVar[int]
    number: int
    change: RecordingChange.Change
    timestamp: _timestamp_pb2.Timestamp
    author: str
    name: str
    note: str
    tags: _containers.RepeatedScalarFieldContainer[str]
    reason: str
    sha256: str
    bytes: int
    def __init__(self, number: _Optional[int] = ..., change: _Optional[_Union[RecordingChange.Change, str]] = ..., timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., author: _Optional[str] = ..., name: _Optional[str] = ..., note: _Optional[str] = ..., tags: _Optional[_Iterable[str]] = ..., reason: _Optional[str] = ..., sha256: _Optional[str] = ..., bytes: _Optional[int] = ...) -> None: ...

class RecordingRequest(_message.Message):
    __slots__ = ("action", "file", "based_on", "name", "note", "tags", "reason")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_UNSPECIFIED: _ClassVar[RecordingRequest.Action]
        RENAME: _ClassVar[RecordingRequest.Action]
        NOTE: _ClassVar[RecordingRequest.Action]
        TAG: _ClassVar[RecordingRequest.Action]
        DELETE: _ClassVar[RecordingRequest.Action]
    ACTION_UNSPECIFIED: RecordingRequest.Action
    RENAME: RecordingRequest.Action
    NOTE: RecordingRequest.Action
    TAG: RecordingRequest.Action
    DELETE: RecordingRequest.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    FILE_FIELD_NUMBER: _ClassVar[int]
    BASED_ON_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    NOTE_FIELD_NUMBER: _ClassVar[int]
    TAGS_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    action: RecordingRequest.Action
    file: str
    based_on: int
    name: str
    note: str
    tags: _containers.RepeatedScalarFieldContainer[str]
    reason: str
    def __init__(self, action: _Optional[_Union[RecordingRequest.Action, str]] = ..., file: _Optional[str] = ..., based_on: _Optional[int] = ..., name: _Optional[str] = ..., note: _Optional[str] = ..., tags: _Optional[_Iterable[str]] = ..., reason: _Optional[str] = ...) -> None: ...

class RecordingListQuery(_message.Message):
    __slots__ = ("deleted",)
    DELETED_FIELD_NUMBER: _ClassVar[int]
    deleted: bool
    def __init__(self, deleted: _Optional[bool] = ...) -> None: ...

class RecordingList(_message.Message):
    __slots__ = ("recordings", "free_bytes", "flight")
    RECORDINGS_FIELD_NUMBER: _ClassVar[int]
    FREE_BYTES_FIELD_NUMBER: _ClassVar[int]
    FLIGHT_FIELD_NUMBER: _ClassVar[int]
    recordings: _containers.RepeatedCompositeFieldContainer[Recording]
    free_bytes: int
    flight: bool
    def __init__(self, recordings: _Optional[_Iterable[_Union[Recording, _Mapping]]] = ..., free_bytes: _Optional[int] = ..., flight: _Optional[bool] = ...) -> None: ...

class RecordingQuery(_message.Message):
    __slots__ = ("file",)
    FILE_FIELD_NUMBER: _ClassVar[int]
    file: str
    def __init__(self, file: _Optional[str] = ...) -> None: ...

class RangeRequest(_message.Message):
    __slots__ = ("file", "topic", "start", "end", "most", "from_key_frame", "skip")
    FILE_FIELD_NUMBER: _ClassVar[int]
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    END_FIELD_NUMBER: _ClassVar[int]
    MOST_FIELD_NUMBER: _ClassVar[int]
    FROM_KEY_FRAME_FIELD_NUMBER: _ClassVar[int]
    SKIP_FIELD_NUMBER: _ClassVar[int]
    file: str
    topic: str
    start: _timestamp_pb2.Timestamp
    end: _timestamp_pb2.Timestamp
    most: int
    from_key_frame: bool
    skip: int
    def __init__(self, file: _Optional[str] = ..., topic: _Optional[str] = ..., start: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., end: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., most: _Optional[int] = ..., from_key_frame: _Optional[bool] = ..., skip: _Optional[int] = ...) -> None: ...

class RecordedMessages(_message.Message):
    __slots__ = ("messages", "more", "schema")
    class Message(_message.Message):
        __slots__ = ("received", "source", "sequence", "data")
        RECEIVED_FIELD_NUMBER: _ClassVar[int]
        SOURCE_FIELD_NUMBER: _ClassVar[int]
        SEQUENCE_FIELD_NUMBER: _ClassVar[int]
        DATA_FIELD_NUMBER: _ClassVar[int]
        received: _timestamp_pb2.Timestamp
        source: _timestamp_pb2.Timestamp
        sequence: int
        data: bytes
        def __init__(self, received: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., source: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., sequence: _Optional[int] = ..., data: _Optional[bytes] = ...) -> None: ...
    MESSAGES_FIELD_NUMBER: _ClassVar[int]
    MORE_FIELD_NUMBER: _ClassVar[int]
    SCHEMA_FIELD_NUMBER: _ClassVar[int]
    messages: _containers.RepeatedCompositeFieldContainer[RecordedMessages.Message]
    more: bool
    schema: str
    def __init__(self, messages: _Optional[_Iterable[_Union[RecordedMessages.Message, _Mapping]]] = ..., more: _Optional[bool] = ..., schema: _Optional[str] = ...) -> None: ...

class SeriesRequest(_message.Message):
    __slots__ = ("file", "values", "start", "end", "points", "robot")
    FILE_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    END_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    file: str
    values: _containers.RepeatedScalarFieldContainer[str]
    start: _timestamp_pb2.Timestamp
    end: _timestamp_pb2.Timestamp
    points: int
    robot: str
    def __init__(self, file: _Optional[str] = ..., values: _Optional[_Iterable[str]] = ..., start: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., end: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., points: _Optional[int] = ..., robot: _Optional[str] = ...) -> None: ...

class SeriesAnswer(_message.Message):
    __slots__ = ("known", "series", "recorded")
    class Series(_message.Message):
        __slots__ = ("name", "unit", "times_s", "lowest", "highest")
        NAME_FIELD_NUMBER: _ClassVar[int]
        UNIT_FIELD_NUMBER: _ClassVar[int]
        TIMES_S_FIELD_NUMBER: _ClassVar[int]
        LOWEST_FIELD_NUMBER: _ClassVar[int]
        HIGHEST_FIELD_NUMBER: _ClassVar[int]
        name: str
        unit: str
        times_s: _containers.RepeatedScalarFieldContainer[float]
        lowest: _containers.RepeatedScalarFieldContainer[float]
        highest: _containers.RepeatedScalarFieldContainer[float]
        def __init__(self, name: _Optional[str] = ..., unit: _Optional[str] = ..., times_s: _Optional[_Iterable[float]] = ..., lowest: _Optional[_Iterable[float]] = ..., highest: _Optional[_Iterable[float]] = ...) -> None: ...
    class Span(_message.Message):
        __slots__ = ("start_s", "end_s")
        START_S_FIELD_NUMBER: _ClassVar[int]
        END_S_FIELD_NUMBER: _ClassVar[int]
        start_s: float
        end_s: float
        def __init__(self, start_s: _Optional[float] = ..., end_s: _Optional[float] = ...) -> None: ...
    KNOWN_FIELD_NUMBER: _ClassVar[int]
    SERIES_FIELD_NUMBER: _ClassVar[int]
    RECORDED_FIELD_NUMBER: _ClassVar[int]
    known: _containers.RepeatedScalarFieldContainer[str]
    series: _containers.RepeatedCompositeFieldContainer[SeriesAnswer.Series]
    recorded: _containers.RepeatedCompositeFieldContainer[SeriesAnswer.Span]
    def __init__(self, known: _Optional[_Iterable[str]] = ..., series: _Optional[_Iterable[_Union[SeriesAnswer.Series, _Mapping]]] = ..., recorded: _Optional[_Iterable[_Union[SeriesAnswer.Span, _Mapping]]] = ...) -> None: ...

class PieceRequest(_message.Message):
    __slots__ = ("file", "offset", "length", "attachment")
    FILE_FIELD_NUMBER: _ClassVar[int]
    OFFSET_FIELD_NUMBER: _ClassVar[int]
    LENGTH_FIELD_NUMBER: _ClassVar[int]
    ATTACHMENT_FIELD_NUMBER: _ClassVar[int]
    file: str
    offset: int
    length: int
    attachment: str
    def __init__(self, file: _Optional[str] = ..., offset: _Optional[int] = ..., length: _Optional[int] = ..., attachment: _Optional[str] = ...) -> None: ...

class Piece(_message.Message):
    __slots__ = ("data", "total", "version", "media_type")
    DATA_FIELD_NUMBER: _ClassVar[int]
    TOTAL_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    MEDIA_TYPE_FIELD_NUMBER: _ClassVar[int]
    data: bytes
    total: int
    version: str
    media_type: str
    def __init__(self, data: _Optional[bytes] = ..., total: _Optional[int] = ..., version: _Optional[str] = ..., media_type: _Optional[str] = ...) -> None: ...

class PlayRequest(_message.Message):
    __slots__ = ("file", "position_s", "speed", "loop", "paused", "session")
    FILE_FIELD_NUMBER: _ClassVar[int]
    POSITION_S_FIELD_NUMBER: _ClassVar[int]
    SPEED_FIELD_NUMBER: _ClassVar[int]
    LOOP_FIELD_NUMBER: _ClassVar[int]
    PAUSED_FIELD_NUMBER: _ClassVar[int]
    SESSION_FIELD_NUMBER: _ClassVar[int]
    file: str
    position_s: float
    speed: float
    loop: bool
    paused: bool
    session: str
    def __init__(self, file: _Optional[str] = ..., position_s: _Optional[float] = ..., speed: _Optional[float] = ..., loop: _Optional[bool] = ..., paused: _Optional[bool] = ..., session: _Optional[str] = ...) -> None: ...

class ReplayRequest(_message.Message):
    __slots__ = ("action", "position_s", "speed", "loop")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_UNSPECIFIED: _ClassVar[ReplayRequest.Action]
        PLAY: _ClassVar[ReplayRequest.Action]
        PAUSE: _ClassVar[ReplayRequest.Action]
        SEEK: _ClassVar[ReplayRequest.Action]
        SPEED: _ClassVar[ReplayRequest.Action]
        LOOP: _ClassVar[ReplayRequest.Action]
        CLOSE: _ClassVar[ReplayRequest.Action]
    ACTION_UNSPECIFIED: ReplayRequest.Action
    PLAY: ReplayRequest.Action
    PAUSE: ReplayRequest.Action
    SEEK: ReplayRequest.Action
    SPEED: ReplayRequest.Action
    LOOP: ReplayRequest.Action
    CLOSE: ReplayRequest.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    POSITION_S_FIELD_NUMBER: _ClassVar[int]
    SPEED_FIELD_NUMBER: _ClassVar[int]
    LOOP_FIELD_NUMBER: _ClassVar[int]
    action: ReplayRequest.Action
    position_s: float
    speed: float
    loop: bool
    def __init__(self, action: _Optional[_Union[ReplayRequest.Action, str]] = ..., position_s: _Optional[float] = ..., speed: _Optional[float] = ..., loop: _Optional[bool] = ...) -> None: ...

class ReplayState(_message.Message):
    __slots__ = ("timestamp", "robot", "file", "of_site", "of_robot", "start", "duration_s", "position_s", "speed", "playing", "loop", "text", "reason")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    FILE_FIELD_NUMBER: _ClassVar[int]
    OF_SITE_FIELD_NUMBER: _ClassVar[int]
    OF_ROBOT_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    DURATION_S_FIELD_NUMBER: _ClassVar[int]
    POSITION_S_FIELD_NUMBER: _ClassVar[int]
    SPEED_FIELD_NUMBER: _ClassVar[int]
    PLAYING_FIELD_NUMBER: _ClassVar[int]
    LOOP_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    robot: str
    file: str
    of_site: str
    of_robot: str
    start: _timestamp_pb2.Timestamp
    duration_s: float
    position_s: float
    speed: float
    playing: bool
    loop: bool
    text: str
    reason: Reason
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., robot: _Optional[str] = ..., file: _Optional[str] = ..., of_site: _Optional[str] = ..., of_robot: _Optional[str] = ..., start: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., duration_s: _Optional[float] = ..., position_s: _Optional[float] = ..., speed: _Optional[float] = ..., playing: _Optional[bool] = ..., loop: _Optional[bool] = ..., text: _Optional[str] = ..., reason: _Optional[_Union[Reason, _Mapping]] = ...) -> None: ...

class ServiceHealth(_message.Message):
    __slots__ = ("timestamp", "service", "id", "version", "host", "pid", "started", "cpu", "memory_bytes", "open_files", "published", "received", "lost", "turned_away", "values", "robots", "zenoh_id", "ignored", "ignored_examples", "problems")
    class ValuesEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: float
        def __init__(self, key: _Optional[str] = ..., value: _Optional[float] = ...) -> None: ...
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SERVICE_FIELD_NUMBER: _ClassVar[int]
    ID_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    HOST_FIELD_NUMBER: _ClassVar[int]
    PID_FIELD_NUMBER: _ClassVar[int]
    STARTED_FIELD_NUMBER: _ClassVar[int]
    CPU_FIELD_NUMBER: _ClassVar[int]
    MEMORY_BYTES_FIELD_NUMBER: _ClassVar[int]
    OPEN_FILES_FIELD_NUMBER: _ClassVar[int]
    PUBLISHED_FIELD_NUMBER: _ClassVar[int]
    RECEIVED_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    TURNED_AWAY_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    ROBOTS_FIELD_NUMBER: _ClassVar[int]
    ZENOH_ID_FIELD_NUMBER: _ClassVar[int]
    IGNORED_FIELD_NUMBER: _ClassVar[int]
    IGNORED_EXAMPLES_FIELD_NUMBER: _ClassVar[int]
    PROBLEMS_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    service: str
    id: str
    version: str
    host: str
    pid: int
    started: _timestamp_pb2.Timestamp
    cpu: float
    memory_bytes: int
    open_files: int
    published: int
    received: int
    lost: int
    turned_away: int
    values: _containers.ScalarMap[str, float]
    robots: _containers.RepeatedScalarFieldContainer[str]
    zenoh_id: str
    ignored: int
    ignored_examples: _containers.RepeatedScalarFieldContainer[str]
    problems: _containers.RepeatedCompositeFieldContainer[Reason]
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., service: _Optional[str] = ..., id: _Optional[str] = ..., version: _Optional[str] = ..., host: _Optional[str] = ..., pid: _Optional[int] = ..., started: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., cpu: _Optional[float] = ..., memory_bytes: _Optional[int] = ..., open_files: _Optional[int] = ..., published: _Optional[int] = ..., received: _Optional[int] = ..., lost: _Optional[int] = ..., turned_away: _Optional[int] = ..., values: _Optional[_Mapping[str, float]] = ..., robots: _Optional[_Iterable[str]] = ..., zenoh_id: _Optional[str] = ..., ignored: _Optional[int] = ..., ignored_examples: _Optional[_Iterable[str]] = ..., problems: _Optional[_Iterable[_Union[Reason, _Mapping]]] = ...) -> None: ...

class ClockRequest(_message.Message):
    __slots__ = ("asked",)
    ASKED_FIELD_NUMBER: _ClassVar[int]
    asked: _timestamp_pb2.Timestamp
    def __init__(self, asked: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...

class ClockAnswer(_message.Message):
    __slots__ = ("received", "answered")
    RECEIVED_FIELD_NUMBER: _ClassVar[int]
    ANSWERED_FIELD_NUMBER: _ClassVar[int]
    received: _timestamp_pb2.Timestamp
    answered: _timestamp_pb2.Timestamp
    def __init__(self, received: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., answered: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...

class MeshState(_message.Message):
    __slots__ = ("timestamp", "site", "services", "hops")
    class Seen(_message.Message):
        __slots__ = ("site", "service", "id", "host", "version", "age_s", "round_trip_s", "clock_offset_s", "lost", "received", "robots", "cpu", "memory_bytes", "started", "values")
        class ValuesEntry(_message.Message):
            __slots__ = ("key", "value")
            KEY_FIELD_NUMBER: _ClassVar[int]
            VALUE_FIELD_NUMBER: _ClassVar[int]
            key: str
            value: float
            def __init__(self, key: _Optional[str] = ..., value: _Optional[float] = ...) -> None: ...
        SITE_FIELD_NUMBER: _ClassVar[int]
        SERVICE_FIELD_NUMBER: _ClassVar[int]
        ID_FIELD_NUMBER: _ClassVar[int]
        HOST_FIELD_NUMBER: _ClassVar[int]
        VERSION_FIELD_NUMBER: _ClassVar[int]
        AGE_S_FIELD_NUMBER: _ClassVar[int]
        ROUND_TRIP_S_FIELD_NUMBER: _ClassVar[int]
        CLOCK_OFFSET_S_FIELD_NUMBER: _ClassVar[int]
        LOST_FIELD_NUMBER: _ClassVar[int]
        RECEIVED_FIELD_NUMBER: _ClassVar[int]
        ROBOTS_FIELD_NUMBER: _ClassVar[int]
        CPU_FIELD_NUMBER: _ClassVar[int]
        MEMORY_BYTES_FIELD_NUMBER: _ClassVar[int]
        STARTED_FIELD_NUMBER: _ClassVar[int]
        VALUES_FIELD_NUMBER: _ClassVar[int]
        site: str
        service: str
        id: str
        host: str
        version: str
        age_s: float
        round_trip_s: float
        clock_offset_s: float
        lost: int
        received: int
        robots: _containers.RepeatedScalarFieldContainer[str]
        cpu: float
        memory_bytes: int
        started: _timestamp_pb2.Timestamp
        values: _containers.ScalarMap[str, float]
        def __init__(self, site: _Optional[str] = ..., service: _Optional[str] = ..., id: _Optional[str] = ..., host: _Optional[str] = ..., version: _Optional[str] = ..., age_s: _Optional[float] = ..., round_trip_s: _Optional[float] = ..., clock_offset_s: _Optional[float] = ..., lost: _Optional[int] = ..., received: _Optional[int] = ..., robots: _Optional[_Iterable[str]] = ..., cpu: _Optional[float] = ..., memory_bytes: _Optional[int] = ..., started: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., values: _Optional[_Mapping[str, float]] = ...) -> None: ...
    class Hop(_message.Message):
        __slots__ = ("key", "sender", "receiver", "p50_s", "p99_s")
        KEY_FIELD_NUMBER: _ClassVar[int]
        SENDER_FIELD_NUMBER: _ClassVar[int]
        RECEIVER_FIELD_NUMBER: _ClassVar[int]
        P50_S_FIELD_NUMBER: _ClassVar[int]
        P99_S_FIELD_NUMBER: _ClassVar[int]
        key: str
        sender: str
        receiver: str
        p50_s: float
        p99_s: float
        def __init__(self, key: _Optional[str] = ..., sender: _Optional[str] = ..., receiver: _Optional[str] = ..., p50_s: _Optional[float] = ..., p99_s: _Optional[float] = ...) -> None: ...
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    SITE_FIELD_NUMBER: _ClassVar[int]
    SERVICES_FIELD_NUMBER: _ClassVar[int]
    HOPS_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    site: str
    services: _containers.RepeatedCompositeFieldContainer[MeshState.Seen]
    hops: _containers.RepeatedCompositeFieldContainer[MeshState.Hop]
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., site: _Optional[str] = ..., services: _Optional[_Iterable[_Union[MeshState.Seen, _Mapping]]] = ..., hops: _Optional[_Iterable[_Union[MeshState.Hop, _Mapping]]] = ...) -> None: ...

class Alarm(_message.Message):
    __slots__ = ("id", "site", "robot", "source", "code", "text", "priority", "state", "since", "last", "count", "returned", "by", "at", "shelved_until", "reason", "advice", "values", "cause")
    class Priority(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        PRIORITY_UNSPECIFIED: _ClassVar[Alarm.Priority]
        LOW: _ClassVar[Alarm.Priority]
        MEDIUM: _ClassVar[Alarm.Priority]
        HIGH: _ClassVar[Alarm.Priority]
        CRITICAL: _ClassVar[Alarm.Priority]
    PRIORITY_UNSPECIFIED: Alarm.Priority
    LOW: Alarm.Priority
    MEDIUM: Alarm.Priority
    HIGH: Alarm.Priority
    CRITICAL: Alarm.Priority
    class State(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        STATE_UNSPECIFIED: _ClassVar[Alarm.State]
        UNACKNOWLEDGED: _ClassVar[Alarm.State]
        ACKNOWLEDGED: _ClassVar[Alarm.State]
        RETURNED: _ClassVar[Alarm.State]
        SHELVED: _ClassVar[Alarm.State]
    STATE_UNSPECIFIED: Alarm.State
    UNACKNOWLEDGED: Alarm.State
    ACKNOWLEDGED: Alarm.State
    RETURNED: Alarm.State
    SHELVED: Alarm.State
    class ValuesEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: str
        def __init__(self, key: _Optional[str] = ..., value: _Optional[str] = ...) -> None: ...
    ID_FIELD_NUMBER: _ClassVar[int]
    SITE_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    CODE_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    PRIORITY_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    SINCE_FIELD_NUMBER: _ClassVar[int]
    LAST_FIELD_NUMBER: _ClassVar[int]
    COUNT_FIELD_NUMBER: _ClassVar[int]
    RETURNED_FIELD_NUMBER: _ClassVar[int]
    BY_FIELD_NUMBER: _ClassVar[int]
    AT_FIELD_NUMBER: _ClassVar[int]
    SHELVED_UNTIL_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    ADVICE_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    id: str
    site: str
    robot: str
    source: str
    code: str
    text: str
    priority: Alarm.Priority
    state: Alarm.State
    since: _timestamp_pb2.Timestamp
    last: _timestamp_pb2.Timestamp
    count: int
    returned: _timestamp_pb2.Timestamp
    by: str
    at: _timestamp_pb2.Timestamp
    shelved_until: _timestamp_pb2.Timestamp
    reason: str
    advice: str
    values: _containers.ScalarMap[str, str]
    cause: Reason
    def __init__(self, id: _Optional[str] = ..., site: _Optional[str] = ..., robot: _Optional[str] = ..., source: _Optional[str] = ..., code: _Optional[str] = ..., text: _Optional[str] = ..., priority: _Optional[_Union[Alarm.Priority, str]] = ..., state: _Optional[_Union[Alarm.State, str]] = ..., since: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., last: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., count: _Optional[int] = ..., returned: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., by: _Optional[str] = ..., at: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., shelved_until: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., reason: _Optional[str] = ..., advice: _Optional[str] = ..., values: _Optional[_Mapping[str, str]] = ..., cause: _Optional[_Union[Reason, _Mapping]] = ...) -> None: ...

class AlarmList(_message.Message):
    __slots__ = ("alarms", "site")
    ALARMS_FIELD_NUMBER: _ClassVar[int]
    SITE_FIELD_NUMBER: _ClassVar[int]
    alarms: _containers.RepeatedCompositeFieldContainer[Alarm]
    site: str
    def __init__(self, alarms: _Optional[_Iterable[_Union[Alarm, _Mapping]]] = ..., site: _Optional[str] = ...) -> None: ...

class AlarmRequest(_message.Message):
    __slots__ = ("action", "ids", "reason", "shelve_s")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_UNSPECIFIED: _ClassVar[AlarmRequest.Action]
        ACKNOWLEDGE: _ClassVar[AlarmRequest.Action]
        SHELVE: _ClassVar[AlarmRequest.Action]
        UNSHELVE: _ClassVar[AlarmRequest.Action]
    ACTION_UNSPECIFIED: AlarmRequest.Action
    ACKNOWLEDGE: AlarmRequest.Action
    SHELVE: AlarmRequest.Action
    UNSHELVE: AlarmRequest.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    IDS_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    SHELVE_S_FIELD_NUMBER: _ClassVar[int]
    action: AlarmRequest.Action
    ids: _containers.RepeatedScalarFieldContainer[str]
    reason: str
    shelve_s: float
    def __init__(self, action: _Optional[_Union[AlarmRequest.Action, str]] = ..., ids: _Optional[_Iterable[str]] = ..., reason: _Optional[str] = ..., shelve_s: _Optional[float] = ...) -> None: ...

class ProgramVersion(_message.Message):
    __slots__ = ("number", "change", "timestamp", "author", "name", "sha256", "bytes", "based_on", "reason")
    class Change(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        CHANGE_UNSPECIFIED: _ClassVar[ProgramVersion.Change]
        SAVED: _ClassVar[ProgramVersion.Change]
        ASIDE: _ClassVar[ProgramVersion.Change]
        RENAMED: _ClassVar[ProgramVersion.Change]
        RESTORED: _ClassVar[ProgramVersion.Change]
        DELETED: _ClassVar[ProgramVersion.Change]
        RUN: _ClassVar[ProgramVersion.Change]
    CHANGE_UNSPECIFIED: ProgramVersion.Change
    SAVED: ProgramVersion.Change
    ASIDE: ProgramVersion.Change
    RENAMED: ProgramVersion.Change
    RESTORED: ProgramVersion.Change
    DELETED: ProgramVersion.Change
    RUN: ProgramVersion.Change
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    CHANGE_FIELD_NUMBER: _ClassVar[int]
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    AUTHOR_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    SHA256_FIELD_NUMBER: _ClassVar[int]
    BYTES_FIELD_NUMBER: _ClassVar[int]
    BASED_ON_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    number: int
    change: ProgramVersion.Change
    timestamp: _timestamp_pb2.Timestamp
    author: str
    name: str
    sha256: str
    bytes: int
    based_on: int
    reason: str
    def __init__(self, number: _Optional[int] = ..., change: _Optional[_Union[ProgramVersion.Change, str]] = ..., timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., author: _Optional[str] = ..., name: _Optional[str] = ..., sha256: _Optional[str] = ..., bytes: _Optional[int] = ..., based_on: _Optional[int] = ..., reason: _Optional[str] = ...) -> None: ...

class StoredLayout(_message.Message):
    __slots__ = ("name", "text", "author", "timestamp")
    NAME_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    AUTHOR_FIELD_NUMBER: _ClassVar[int]
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    name: str
    text: str
    author: str
    timestamp: _timestamp_pb2.Timestamp
    def __init__(self, name: _Optional[str] = ..., text: _Optional[str] = ..., author: _Optional[str] = ..., timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...

class LayoutList(_message.Message):
    __slots__ = ("layouts",)
    LAYOUTS_FIELD_NUMBER: _ClassVar[int]
    layouts: _containers.RepeatedCompositeFieldContainer[StoredLayout]
    def __init__(self, layouts: _Optional[_Iterable[_Union[StoredLayout, _Mapping]]] = ...) -> None: ...

class LayoutRequest(_message.Message):
    __slots__ = ("action", "name", "text", "new_name", "replace")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_UNSPECIFIED: _ClassVar[LayoutRequest.Action]
        SAVE: _ClassVar[LayoutRequest.Action]
        RENAME: _ClassVar[LayoutRequest.Action]
        DELETE: _ClassVar[LayoutRequest.Action]
    ACTION_UNSPECIFIED: LayoutRequest.Action
    SAVE: LayoutRequest.Action
    RENAME: LayoutRequest.Action
    DELETE: LayoutRequest.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    NEW_NAME_FIELD_NUMBER: _ClassVar[int]
    REPLACE_FIELD_NUMBER: _ClassVar[int]
    action: LayoutRequest.Action
    name: str
    text: str
    new_name: str
    replace: bool
    def __init__(self, action: _Optional[_Union[LayoutRequest.Action, str]] = ..., name: _Optional[str] = ..., text: _Optional[str] = ..., new_name: _Optional[str] = ..., replace: _Optional[bool] = ...) -> None: ...

class StoredProgram(_message.Message):
    __slots__ = ("id", "current", "versions")
    ID_FIELD_NUMBER: _ClassVar[int]
    CURRENT_FIELD_NUMBER: _ClassVar[int]
    VERSIONS_FIELD_NUMBER: _ClassVar[int]
    id: str
    current: ProgramVersion
    versions: int
    def __init__(self, id: _Optional[str] = ..., current: _Optional[_Union[ProgramVersion, _Mapping]] = ..., versions: _Optional[int] = ...) -> None: ...

class ProgramList(_message.Message):
    __slots__ = ("programs",)
    PROGRAMS_FIELD_NUMBER: _ClassVar[int]
    programs: _containers.RepeatedCompositeFieldContainer[StoredProgram]
    def __init__(self, programs: _Optional[_Iterable[_Union[StoredProgram, _Mapping]]] = ...) -> None: ...

class ProgramRequest(_message.Message):
    __slots__ = ("action", "robot", "id", "based_on", "name", "text", "version", "reason")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_UNSPECIFIED: _ClassVar[ProgramRequest.Action]
        SAVE: _ClassVar[ProgramRequest.Action]
        RENAME: _ClassVar[ProgramRequest.Action]
        DELETE: _ClassVar[ProgramRequest.Action]
        RESTORE: _ClassVar[ProgramRequest.Action]
    ACTION_UNSPECIFIED: ProgramRequest.Action
    SAVE: ProgramRequest.Action
    RENAME: ProgramRequest.Action
    DELETE: ProgramRequest.Action
    RESTORE: ProgramRequest.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    ID_FIELD_NUMBER: _ClassVar[int]
    BASED_ON_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    action: ProgramRequest.Action
    robot: str
    id: str
    based_on: int
    name: str
    text: str
    version: int
    reason: str
    def __init__(self, action: _Optional[_Union[ProgramRequest.Action, str]] = ..., robot: _Optional[str] = ..., id: _Optional[str] = ..., based_on: _Optional[int] = ..., name: _Optional[str] = ..., text: _Optional[str] = ..., version: _Optional[int] = ..., reason: _Optional[str] = ...) -> None: ...

class ProgramAnswer(_message.Message):
    __slots__ = ("program", "version")
    PROGRAM_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    program: StoredProgram
    version: ProgramVersion
    def __init__(self, program: _Optional[_Union[StoredProgram, _Mapping]] = ..., version: _Optional[_Union[ProgramVersion, _Mapping]] = ...) -> None: ...

class ProgramQuery(_message.Message):
    __slots__ = ("robot", "id", "version", "sha256")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    ID_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    SHA256_FIELD_NUMBER: _ClassVar[int]
    robot: str
    id: str
    version: int
    sha256: str
    def __init__(self, robot: _Optional[str] = ..., id: _Optional[str] = ..., version: _Optional[int] = ..., sha256: _Optional[str] = ...) -> None: ...

class ProgramContent(_message.Message):
    __slots__ = ("program", "versions", "version", "text")
    PROGRAM_FIELD_NUMBER: _ClassVar[int]
    VERSIONS_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    program: StoredProgram
    versions: _containers.RepeatedCompositeFieldContainer[ProgramVersion]
    version: ProgramVersion
    text: str
    def __init__(self, program: _Optional[_Union[StoredProgram, _Mapping]] = ..., versions: _Optional[_Iterable[_Union[ProgramVersion, _Mapping]]] = ..., version: _Optional[_Union[ProgramVersion, _Mapping]] = ..., text: _Optional[str] = ...) -> None: ...

class CellContent(_message.Message):
    __slots__ = ("fixtures", "floor")
    FIXTURES_FIELD_NUMBER: _ClassVar[int]
    FLOOR_FIELD_NUMBER: _ClassVar[int]
    fixtures: _containers.RepeatedCompositeFieldContainer[CellFixture]
    floor: CellFloor
    def __init__(self, fixtures: _Optional[_Iterable[_Union[CellFixture, _Mapping]]] = ..., floor: _Optional[_Union[CellFloor, _Mapping]] = ...) -> None: ...

class CellFixture(_message.Message):
    __slots__ = ("name", "box", "cylinder", "sphere", "mesh", "xyz", "rpy", "color", "exact", "ignore")
    NAME_FIELD_NUMBER: _ClassVar[int]
    BOX_FIELD_NUMBER: _ClassVar[int]
    CYLINDER_FIELD_NUMBER: _ClassVar[int]
    SPHERE_FIELD_NUMBER: _ClassVar[int]
    MESH_FIELD_NUMBER: _ClassVar[int]
    XYZ_FIELD_NUMBER: _ClassVar[int]
    RPY_FIELD_NUMBER: _ClassVar[int]
    COLOR_FIELD_NUMBER: _ClassVar[int]
    EXACT_FIELD_NUMBER: _ClassVar[int]
    IGNORE_FIELD_NUMBER: _ClassVar[int]
    name: str
    box: Vector3
    cylinder: CellCylinder
    sphere: float
    mesh: CellMesh
    xyz: Vector3
    rpy: Vector3
    color: str
    exact: bool
    ignore: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, name: _Optional[str] = ..., box: _Optional[_Union[Vector3, _Mapping]] = ..., cylinder: _Optional[_Union[CellCylinder, _Mapping]] = ..., sphere: _Optional[float] = ..., mesh: _Optional[_Union[CellMesh, _Mapping]] = ..., xyz: _Optional[_Union[Vector3, _Mapping]] = ..., rpy: _Optional[_Union[Vector3, _Mapping]] = ..., color: _Optional[str] = ..., exact: _Optional[bool] = ..., ignore: _Optional[_Iterable[str]] = ...) -> None: ...

class CellCylinder(_message.Message):
    __slots__ = ("radius", "height")
    RADIUS_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    radius: float
    height: float
    def __init__(self, radius: _Optional[float] = ..., height: _Optional[float] = ...) -> None: ...

class CellMesh(_message.Message):
    __slots__ = ("file", "scale")
    FILE_FIELD_NUMBER: _ClassVar[int]
    SCALE_FIELD_NUMBER: _ClassVar[int]
    file: str
    scale: float
    def __init__(self, file: _Optional[str] = ..., scale: _Optional[float] = ...) -> None: ...

class CellFloor(_message.Message):
    __slots__ = ("none", "height", "warning_distance", "stop_distance")
    NONE_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    WARNING_DISTANCE_FIELD_NUMBER: _ClassVar[int]
    STOP_DISTANCE_FIELD_NUMBER: _ClassVar[int]
    none: bool
    height: float
    warning_distance: float
    stop_distance: float
    def __init__(self, none: _Optional[bool] = ..., height: _Optional[float] = ..., warning_distance: _Optional[float] = ..., stop_distance: _Optional[float] = ...) -> None: ...

class CellState(_message.Message):
    __slots__ = ("timestamp", "cell", "version", "content", "changing", "problem", "previous", "meshes", "robots", "file")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    CELL_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    CONTENT_FIELD_NUMBER: _ClassVar[int]
    CHANGING_FIELD_NUMBER: _ClassVar[int]
    PROBLEM_FIELD_NUMBER: _ClassVar[int]
    PREVIOUS_FIELD_NUMBER: _ClassVar[int]
    MESHES_FIELD_NUMBER: _ClassVar[int]
    ROBOTS_FIELD_NUMBER: _ClassVar[int]
    FILE_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    cell: str
    version: str
    content: CellContent
    changing: bool
    problem: Reason
    previous: CellContent
    meshes: _containers.RepeatedScalarFieldContainer[str]
    robots: _containers.RepeatedCompositeFieldContainer[CellMember]
    file: str
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., cell: _Optional[str] = ..., version: _Optional[str] = ..., content: _Optional[_Union[CellContent, _Mapping]] = ..., changing: _Optional[bool] = ..., problem: _Optional[_Union[Reason, _Mapping]] = ..., previous: _Optional[_Union[CellContent, _Mapping]] = ..., meshes: _Optional[_Iterable[str]] = ..., robots: _Optional[_Iterable[_Union[CellMember, _Mapping]]] = ..., file: _Optional[str] = ...) -> None: ...

class CellMember(_message.Message):
    __slots__ = ("name", "model", "xyz", "rpy", "controller", "protocol", "check", "warning_distance", "stop_distance", "stop_proven")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    XYZ_FIELD_NUMBER: _ClassVar[int]
    RPY_FIELD_NUMBER: _ClassVar[int]
    CONTROLLER_FIELD_NUMBER: _ClassVar[int]
    PROTOCOL_FIELD_NUMBER: _ClassVar[int]
    CHECK_FIELD_NUMBER: _ClassVar[int]
    WARNING_DISTANCE_FIELD_NUMBER: _ClassVar[int]
    STOP_DISTANCE_FIELD_NUMBER: _ClassVar[int]
    STOP_PROVEN_FIELD_NUMBER: _ClassVar[int]
    name: str
    model: str
    xyz: Vector3
    rpy: Vector3
    controller: str
    protocol: str
    check: str
    warning_distance: float
    stop_distance: float
    stop_proven: bool
    def __init__(self, name: _Optional[str] = ..., model: _Optional[str] = ..., xyz: _Optional[_Union[Vector3, _Mapping]] = ..., rpy: _Optional[_Union[Vector3, _Mapping]] = ..., controller: _Optional[str] = ..., protocol: _Optional[str] = ..., check: _Optional[str] = ..., warning_distance: _Optional[float] = ..., stop_distance: _Optional[float] = ..., stop_proven: _Optional[bool] = ...) -> None: ...

class CellRequest(_message.Message):
    __slots__ = ("based_on", "content", "dry_run", "reason")
    BASED_ON_FIELD_NUMBER: _ClassVar[int]
    CONTENT_FIELD_NUMBER: _ClassVar[int]
    DRY_RUN_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    based_on: str
    content: CellContent
    dry_run: bool
    reason: str
    def __init__(self, based_on: _Optional[str] = ..., content: _Optional[_Union[CellContent, _Mapping]] = ..., dry_run: _Optional[bool] = ..., reason: _Optional[str] = ...) -> None: ...

class CellAnswer(_message.Message):
    __slots__ = ("version", "changes")
    VERSION_FIELD_NUMBER: _ClassVar[int]
    CHANGES_FIELD_NUMBER: _ClassVar[int]
    version: str
    changes: _containers.RepeatedCompositeFieldContainer[CellChange]
    def __init__(self, version: _Optional[str] = ..., changes: _Optional[_Iterable[_Union[CellChange, _Mapping]]] = ...) -> None: ...

class CellChange(_message.Message):
    __slots__ = ("kind", "fixture", "key", "before", "after")
    class Kind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        KIND_UNSPECIFIED: _ClassVar[CellChange.Kind]
        CHANGED: _ClassVar[CellChange.Kind]
        ADDED: _ClassVar[CellChange.Kind]
        REMOVED: _ClassVar[CellChange.Kind]
    KIND_UNSPECIFIED: CellChange.Kind
    CHANGED: CellChange.Kind
    ADDED: CellChange.Kind
    REMOVED: CellChange.Kind
    KIND_FIELD_NUMBER: _ClassVar[int]
    FIXTURE_FIELD_NUMBER: _ClassVar[int]
    KEY_FIELD_NUMBER: _ClassVar[int]
    BEFORE_FIELD_NUMBER: _ClassVar[int]
    AFTER_FIELD_NUMBER: _ClassVar[int]
    kind: CellChange.Kind
    fixture: str
    key: str
    before: str
    after: str
    def __init__(self, kind: _Optional[_Union[CellChange.Kind, str]] = ..., fixture: _Optional[str] = ..., key: _Optional[str] = ..., before: _Optional[str] = ..., after: _Optional[str] = ...) -> None: ...

class CellPreparation(_message.Message):
    __slots__ = ("version", "content")
    VERSION_FIELD_NUMBER: _ClassVar[int]
    CONTENT_FIELD_NUMBER: _ClassVar[int]
    version: str
    content: CellContent
    def __init__(self, version: _Optional[str] = ..., content: _Optional[_Union[CellContent, _Mapping]] = ...) -> None: ...

class CellPrepared(_message.Message):
    __slots__ = ("version",)
    VERSION_FIELD_NUMBER: _ClassVar[int]
    version: str
    def __init__(self, version: _Optional[str] = ...) -> None: ...

class CellShown(_message.Message):
    __slots__ = ("version", "problem")
    VERSION_FIELD_NUMBER: _ClassVar[int]
    PROBLEM_FIELD_NUMBER: _ClassVar[int]
    version: str
    problem: Reason
    def __init__(self, version: _Optional[str] = ..., problem: _Optional[_Union[Reason, _Mapping]] = ...) -> None: ...

class ToPage(_message.Message):
    __slots__ = ("sample", "answer", "presence", "hello")
    class Sample(_message.Message):
        __slots__ = ("key", "attachment", "payload", "live", "age_s", "step")
        KEY_FIELD_NUMBER: _ClassVar[int]
        ATTACHMENT_FIELD_NUMBER: _ClassVar[int]
        PAYLOAD_FIELD_NUMBER: _ClassVar[int]
        LIVE_FIELD_NUMBER: _ClassVar[int]
        AGE_S_FIELD_NUMBER: _ClassVar[int]
        STEP_FIELD_NUMBER: _ClassVar[int]
        key: str
        attachment: bytes
        payload: bytes
        live: bool
        age_s: float
        step: int
        def __init__(self, key: _Optional[str] = ..., attachment: _Optional[bytes] = ..., payload: _Optional[bytes] = ..., live: _Optional[bool] = ..., age_s: _Optional[float] = ..., step: _Optional[int] = ...) -> None: ...
    class Answer(_message.Message):
        __slots__ = ("id", "ok", "payload", "error", "no_answer", "refusal")
        ID_FIELD_NUMBER: _ClassVar[int]
        OK_FIELD_NUMBER: _ClassVar[int]
        PAYLOAD_FIELD_NUMBER: _ClassVar[int]
        ERROR_FIELD_NUMBER: _ClassVar[int]
        NO_ANSWER_FIELD_NUMBER: _ClassVar[int]
        REFUSAL_FIELD_NUMBER: _ClassVar[int]
        id: int
        ok: bool
        payload: bytes
        error: str
        no_answer: bool
        refusal: Reason
        def __init__(self, id: _Optional[int] = ..., ok: _Optional[bool] = ..., payload: _Optional[bytes] = ..., error: _Optional[str] = ..., no_answer: _Optional[bool] = ..., refusal: _Optional[_Union[Reason, _Mapping]] = ...) -> None: ...
    class Presence(_message.Message):
        __slots__ = ("key", "alive")
        KEY_FIELD_NUMBER: _ClassVar[int]
        ALIVE_FIELD_NUMBER: _ClassVar[int]
        key: str
        alive: bool
        def __init__(self, key: _Optional[str] = ..., alive: _Optional[bool] = ...) -> None: ...
    class Hello(_message.Message):
        __slots__ = ("version", "site", "insecure", "stale", "connected", "session", "account", "operator", "may_command", "presence_known", "values")
        class Stale(_message.Message):
            __slots__ = ("topic", "after_s")
            TOPIC_FIELD_NUMBER: _ClassVar[int]
            AFTER_S_FIELD_NUMBER: _ClassVar[int]
            topic: str
            after_s: float
            def __init__(self, topic: _Optional[str] = ..., after_s: _Optional[float] = ...) -> None: ...
        class Values(_message.Message):
            __slots__ = ("topic", "schema")
            TOPIC_FIELD_NUMBER: _ClassVar[int]
            SCHEMA_FIELD_NUMBER: _ClassVar[int]
            topic: str
            schema: str
            def __init__(self, topic: _Optional[str] = ..., schema: _Optional[str] = ...) -> None: ...
        VERSION_FIELD_NUMBER: _ClassVar[int]
        SITE_FIELD_NUMBER: _ClassVar[int]
        INSECURE_FIELD_NUMBER: _ClassVar[int]
        STALE_FIELD_NUMBER: _ClassVar[int]
        CONNECTED_FIELD_NUMBER: _ClassVar[int]
        SESSION_FIELD_NUMBER: _ClassVar[int]
        ACCOUNT_FIELD_NUMBER: _ClassVar[int]
        OPERATOR_FIELD_NUMBER: _ClassVar[int]
        MAY_COMMAND_FIELD_NUMBER: _ClassVar[int]
        PRESENCE_KNOWN_FIELD_NUMBER: _ClassVar[int]
        VALUES_FIELD_NUMBER: _ClassVar[int]
        version: str
        site: str
        insecure: bool
        stale: _containers.RepeatedCompositeFieldContainer[ToPage.Hello.Stale]
        connected: bool
        session: str
        account: str
        operator: str
        may_command: bool
        presence_known: bool
        values: _containers.RepeatedCompositeFieldContainer[ToPage.Hello.Values]
        def __init__(self, version: _Optional[str] = ..., site: _Optional[str] = ..., insecure: _Optional[bool] = ..., stale: _Optional[_Iterable[_Union[ToPage.Hello.Stale, _Mapping]]] = ..., connected: _Optional[bool] = ..., session: _Optional[str] = ..., account: _Optional[str] = ..., operator: _Optional[str] = ..., may_command: _Optional[bool] = ..., presence_known: _Optional[bool] = ..., values: _Optional[_Iterable[_Union[ToPage.Hello.Values, _Mapping]]] = ...) -> None: ...
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
