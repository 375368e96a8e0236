"""Samples of topics for Python programs: joint states, events, alarms, and messages of any topic."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cached_property
from math import degrees
from typing import Any

from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp

from robomesh.contract.enum_names import enum_name
from robomesh.errors import MessageError
from robomesh.publications.subscription import Sample as RawSample
from robomesh.schemas import robomesh_pb2 as schema

ROTARY, PRISMATIC = "rotary", "prismatic"


@dataclass(frozen=True, kw_only=True)
class Sample:
    """A message of a topic.

    Attributes:
        site, robot, topic: Parts of its key; robot "-": the whole site.
        message: The protobuf message of the topic; a list message for the history of `events` and `audit`.
        time_ns: Publisher's time, ns since the Unix epoch.
        sequence: Publisher's number; gaps are messages that did not arrive.
        live: Received as a publication; False: the last value, from before the subscription.
        received_s: Time of arrival on this process's monotonic clock, minus the measured delay [s];
            None: unknown, for a last value.
        stale: The message was older than the topic's limit, or of unknown age, when the stream returned it.
        skipped: Number of messages since the previous one of its key that the stream did not return, because
            the program was slow, the network lost them, or they were stale.
    """

    site: str
    robot: str
    topic: str
    # Not `Message`: a type checker would accept no field of it.
    message: Any = field(repr=False)
    time_ns: int
    sequence: int
    live: bool
    received_s: float | None
    stale: bool = False
    skipped: int = 0

    @property
    def time(self) -> datetime:
        """Publisher's time in UTC, to the microsecond."""
        return utc(self.time_ns)

    @property
    def age_s(self) -> float | None:
        """Present age by this process's monotonic clock [s]; None: unknown."""
        return None if self.received_s is None else max(0.0, time.monotonic() - self.received_s)


@dataclass(frozen=True, kw_only=True, repr=False)
class JointState(Sample):
    """Positions and velocities of a robot's joints.

    Attributes:
        types: "rotary" or "prismatic", by joint; None: the robot has no description.
    """

    types: Mapping[str, str] | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        joints = ", ".join(
            f"{name} {value:.4g}" for name, value in zip(self.names, self.positions, strict=True)
        )
        return f"<state of {self.site}/{self.robot} at {self.time:%H:%M:%S.%f}: {joints} [rad, m]>"

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the joints, in the robot's order."""
        return tuple(joint.name for joint in self._joints)

    @cached_property
    def positions(self) -> tuple[float, ...]:
        """Positions [rad], of prismatic joints [m]."""
        return tuple(joint.position for joint in self._joints)

    @cached_property
    def velocities(self) -> tuple[float | None, ...]:
        """Velocities [rad/s], of prismatic joints [m/s]; None: not reported."""
        return tuple(joint.velocity if joint.HasField("velocity") else None for joint in self._joints)

    @cached_property
    def positions_deg(self) -> tuple[float, ...]:
        """Positions in degrees, of prismatic joints in mm.

        Raises:
            MessageError: If the robot has no description, so that the types of its joints are unknown.
        """
        return in_degrees(self.names, self.positions, self.types, robot=f"{self.site}/{self.robot}")

    def __getitem__(self, name: str) -> float:
        """Return the position of a joint [rad or m]."""
        try:
            return self.positions[self.names.index(name)]
        except ValueError:
            raise KeyError(f"no joint {name!r}; there are {', '.join(self.names)}") from None

    @property
    def _joints(self) -> Any:
        assert isinstance(self.message, JointStates)
        return self.message.joints


@dataclass(frozen=True, kw_only=True, repr=False)
class SignalState(Sample):
    """Signals of a robot: what its controller reports in addition to joints; see docs/signals.md."""

    def __repr__(self) -> str:
        return f"<{len(self.values)} signals of {self.site}/{self.robot} at {self.time:%H:%M:%S.%f}>"

    @cached_property
    def values(self) -> Mapping[str, float | bool | str]:
        """Numbers in their unit, booleans and texts, by name; an unknown signal is absent."""
        found = ((each.name, each.WhichOneof("value"), each) for each in self.message.signals)
        return {name: getattr(each, kind) for name, kind, each in found if kind is not None}

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Units by name: "A"; empty: none."""
        return {each.name: each.unit for each in self.message.signals}

    def __getitem__(self, name: str) -> float | bool | str:
        """Return the value of a signal."""
        try:
            return self.values[name]
        except KeyError:
            raise KeyError(f"no signal {name!r}; there are {', '.join(self.values) or 'none'}") from None


@dataclass(frozen=True, kw_only=True)
class Event:
    """An event of a robot or service.

    Attributes:
        robot: "-": the whole site.
        time: Time of the event, UTC.
        severity: "debug", "info", "warning", "error" or "critical".
        code: Stable code for programs: "unit.malformed".
        text: Sentence for people.
        source: Service that reports it.
        values: Parameters.
    """

    site: str
    robot: str
    time: datetime
    severity: str
    code: str
    text: str
    source: str
    values: Mapping[str, str]


@dataclass(frozen=True, kw_only=True)
class Alarm:
    """A condition that needs a person's action.

    Attributes:
        robot: "-": the whole site.
        since: Beginning, UTC.
        priority: "low", "medium", "high" or "critical".
        state: "unacknowledged", "acknowledged", "returned" or "shelved".
        code: Code of its event: "link.lost".
        text: Sentence for people.
        advice: What to do about it.
        by: Operator who acknowledged or shelved it; empty: none.
    """

    id: str
    site: str
    robot: str
    since: datetime
    priority: str
    state: str
    code: str
    text: str
    advice: str
    by: str


def utc(time_ns: int) -> datetime:
    """Return a time, ns since the Unix epoch, in UTC, to the microsecond."""
    second, rest_ns = divmod(time_ns, 1_000_000_000)
    return datetime.fromtimestamp(second, tz=UTC).replace(microsecond=rest_ns // 1000)


def in_degrees(
    names: tuple[str, ...], positions: tuple[float, ...], types: Mapping[str, str] | None, *, robot: str
) -> tuple[float, ...]:
    """Return joint positions in degrees, of prismatic joints in mm.

    Args:
        positions: [rad or m]
        types: Type of each joint; None: unknown.

    Raises:
        MessageError: If the type of a joint is unknown.
    """
    known = {} if types is None else types
    missing = [name for name in names if name not in known]
    if missing:
        raise MessageError(
            f"{robot} has no description of {', '.join(missing)} to convert its position with: start its "
            "kinematics service, or use `positions` (rad, m)"
        )
    return tuple(
        degrees(value) if known[name] == ROTARY else value * 1000.0
        for name, value in zip(names, positions, strict=True)
    )


def joint_types(description: schema.Description) -> dict[str, str]:
    """Return the type of each joint: "rotary" or "prismatic"."""
    rotary = schema.Description.Joint.ROTARY
    return {joint.name: ROTARY if joint.type == rotary else PRISMATIC for joint in description.joints}


def sample_fields(sample: RawSample, message: Message, *, stale: bool, skipped: int) -> dict[str, Any]:
    """Return the fields of a `Sample`.

    Args:
        sample: The sample as received.
    """
    site, robot, topic = sample.parsed
    return {
        "site": site,
        "robot": robot,
        "topic": topic,
        "message": message,
        "time_ns": sample.header.source_time_ns,
        "sequence": sample.header.sequence,
        "live": sample.live,
        "received_s": sample.received - sample.late_s if sample.live else None,
        "stale": stale,
        "skipped": skipped,
    }


def event_of(site: str, robot: str, event: schema.Event) -> Event:
    """Return an event of a robot.

    Raises:
        MessageError: If its time is out of range.
    """
    return Event(
        site=site,
        robot=robot,
        time=_utc(event.timestamp),
        severity=enum_name(schema.Event.Severity, event.severity).lower(),
        code=event.code,
        text=event.text,
        source=event.source,
        values=dict(event.values),
    )


def alarm_of(alarm: schema.Alarm) -> Alarm:
    """Return an alarm of a site's list.

    Raises:
        MessageError: If its time is out of range.
    """
    return Alarm(
        id=alarm.id,
        site=alarm.site,
        robot=alarm.robot,
        since=_utc(alarm.since),
        priority=enum_name(schema.Alarm.Priority, alarm.priority).lower(),
        state=enum_name(schema.Alarm.State, alarm.state).lower(),
        code=alarm.code,
        text=alarm.text,
        advice=alarm.advice,
        by=alarm.by,
    )


def _utc(timestamp: Timestamp) -> datetime:
    try:
        return timestamp.ToDatetime(tzinfo=UTC)
    except (ValueError, OverflowError):
        raise MessageError("a time is out of range") from None
