"""A recording: its joint states and values as NumPy arrays, its events, and messages of any topic.

It is a file of this machine, or one in the folder of a site's recorder, which is read through the mesh.
"""

import logging
from collections.abc import AsyncGenerator, AsyncIterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from google.protobuf.message import DecodeError, Message

from robomesh import reason_codes as codes
from robomesh.client.recordings.arrays import JointsCollector, RecordedJoints, RecordedValues, ValuesCollector
from robomesh.client.recordings.sources import Page, Source
from robomesh.client.robot.samples import Event, event_of, joint_types, utc
from robomesh.contract.keys import parse_key
from robomesh.errors import KeyNameError, MessageError
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.names import robot_channels
from robomesh.recordings.series.publisher_time import Recorded
from robomesh.recordings.series.values import topic_of
from robomesh.schemas import robomesh_pb2 as schema

log = logging.getLogger(__name__)

# What one call reads into memory: a small file must not fill it. States compress to a tenth.
_MOST_BYTES, _MOST_TIMES_THE_FILE = 256 << 20, 200
# Memory of a message beside its bytes: times, and the object.
_MESSAGE_BYTES = 64
_MOST_NAMED = 10
_MOST_S = 1e9
# What an array of integers can represent.
_LAST_NS = (1 << 63) - 1
_JOINTS, _EVENT, _DESCRIPTION = "foxglove.JointStates", "robomesh.Event", "robomesh.Description"


@dataclass(frozen=True, kw_only=True)
class RecordedSample:
    """A recorded message.

    Attributes:
        site, robot, topic: Parts of its key; of another program's channel, `topic` is its whole name.
        message: The protobuf message; None: its schema is unknown, or it is damaged.
        data: Its bytes.
        schema: Full name of its schema: "foxglove.JointStates".
        time_ns: Publisher's time, ns since the Unix epoch.
        received_ns: Receive time on the recorder's clock, ns since the Unix epoch.
        sequence: Publisher's number; gaps are messages that were not recorded.
    """

    site: str
    robot: str
    topic: str
    message: Any = field(repr=False)
    data: bytes = field(repr=False)
    schema: str
    time_ns: int
    received_ns: int
    sequence: int

    @property
    def time(self) -> datetime:
        """Publisher's time in UTC, to the microsecond."""
        return utc(self.time_ns)


class AsyncRecording:
    """A recording, for asynchronous programs.

    `start_s` and `end_s` of its functions limit the time since the recording's start, on the recorder's
    clock [s], both included; None: its start or end. Messages that cannot be decoded are left out, with a
    warning in the log.

    Raises:
        RecordingError: It contains several robots. Of every function: the file is damaged, changed, or lacks
            what was requested.
        RobomeshError: Of every function, over the mesh: the recorder refuses or does not answer.

    Attributes:
        info: Description of the recording.
    """

    def __init__(self, source: Source) -> None:
        self._source = source
        self.info = source.info
        robot_channels({topic.key: topic.messages for topic in self.info.topics}, self.info.file)
        self._types: dict[str, str] | None = None

    def __repr__(self) -> str:
        of = f" of {self.info.site}/{self.info.robot}" if self.info.robot else ""
        return f"<recording {self.info.name!r}{of}>"

    @property
    def topic_names(self) -> tuple[str, ...]:
        """Names of the recorded topics; `info.topics` describes them."""
        return tuple(topic.name for topic in self.info.topics if topic.messages)

    async def value_names(self) -> list[str]:
        """Return the names of the recorded values, as `values` takes them: "kinematics/tool/x"."""
        return await self._source.value_names()

    async def joints(
        self, topic: str = "joints", *, start_s: float | None = None, end_s: float | None = None
    ) -> RecordedJoints:
        """Return the joint states of a topic, with the schema foxglove.JointStates."""
        found = JointsCollector(await self._joint_types(), start_ns=self.info.start_ns)
        async for recorded, message in self._decoded([self._key(topic)], start_s, end_s, _JOINTS):
            found.add(recorded, message)
        return found.collected()

    async def values(
        self, *names: str, start_s: float | None = None, end_s: float | None = None
    ) -> dict[str, RecordedValues]:
        """Return values over time, at the full rate of their topics, by name."""
        wanted: dict[str, list[str]] = {}
        for name in names:
            topic = topic_of(name, self.topic_names)
            if topic is None:
                raise self._no_value(name, [f"{each}/..." for each in self.topic_names])
            wanted.setdefault(topic, []).append(name)
        types = await self._joint_types()
        found: dict[str, RecordedValues] = {}
        for topic, own in wanted.items():
            collector = ValuesCollector(topic, own, start_ns=self.info.start_ns)
            async for recorded, message in self._decoded([self._key(topic)], start_s, end_s):
                collector.add(recorded, message)
            found |= collector.collected(types)
        if missing := [name for name in names if not len(found[name])]:
            known = await self.value_names()
            if unknown := [name for name in missing if name not in known]:
                raise self._no_value(unknown[0], known)
        return {name: found[name] for name in names}

    async def events(self, *, start_s: float | None = None, end_s: float | None = None) -> list[Event]:
        """Return the events of all services, in the order of their times."""
        topics = [each for each in self.info.topics if each.messages]
        keys = [each.key for each in topics if each.name == "events" or each.name.startswith("events/")]
        found: list[Event] = []
        left_out = 0
        async for recorded, event in self._decoded(keys, start_s, end_s, _EVENT):
            assert isinstance(event, schema.Event)
            site, robot, _ = _parts(recorded.topic)
            try:
                found.append(event_of(site, robot, event))
            except MessageError:
                left_out += 1
        self._warn(left_out, "events have a time out of range: left out")
        return sorted(found, key=lambda event: event.time)

    async def messages(
        self, topic: str, *, start_s: float | None = None, end_s: float | None = None
    ) -> AsyncIterator[RecordedSample]:
        """Yield the messages of a topic, in the order of their receive times."""
        async for samples in self.sample_pages(topic, start_s=start_s, end_s=end_s):
            for sample in samples:
                yield sample

    async def sample_pages(
        self, topic: str, *, start_s: float | None = None, end_s: float | None = None
    ) -> AsyncGenerator[list[RecordedSample]]:
        """Yield the messages of a topic as `messages`, in lists of up to some thousand."""
        key = self._key(topic)
        site, robot, name = _parts(key)
        async for page in self._source.pages([key], self._time_ns(start_s), self._time_ns(end_s)):
            yield [
                RecordedSample(
                    site=site,
                    robot=robot,
                    topic=name,
                    message=_decoded(page, each.data),
                    data=each.data,
                    schema=page.schema,
                    time_ns=each.source_ns,
                    received_ns=each.received_ns,
                    sequence=each.sequence,
                )
                for each in page.messages
            ]

    def _key(self, topic: str) -> str:
        """Return the name of a topic's channel; a channel's whole name is itself."""
        recorded = [each for each in self.info.topics if each.messages]
        found = [each.key for each in recorded if topic in (each.name, each.key)]
        if len(found) == 1:
            return found[0]
        there = found or [each.name for each in recorded]
        raise RecordingError(
            codes.RECORDING_NO_TOPIC(file=self.info.file, topic=topic, topics=", ".join(there) or "none")
        )

    def _no_value(self, name: str, known: Sequence[str]) -> RecordingError:
        topic = topic_of(name, self.topic_names) or ""
        known = sorted(known, key=lambda each: not each.startswith(topic))
        there = ", ".join(known[:_MOST_NAMED]) + (", ..." if len(known) > _MOST_NAMED else "")
        reason = codes.RECORDING_NO_VALUE(file=self.info.file, name=name, topics=there or "none")
        return RecordingError(reason)

    async def _joint_types(self) -> dict[str, str]:
        """Return the type of each joint, from the last description."""
        if self._types is None:
            types: dict[str, str] = {}
            if "description" in self.topic_names:
                async for _, message in self._decoded([self._key("description")], None, None, _DESCRIPTION):
                    assert isinstance(message, schema.Description)
                    types = joint_types(message)
            self._types = types  # only a complete one: a read that failed is repeated
        return self._types

    def _time_ns(self, since_start_s: float | None) -> int | None:
        if since_start_s is None:
            return None
        if not abs(since_start_s) < _MOST_S:
            raise RecordingError(f"{since_start_s!r} is not a time since the recording's start [s]")
        return self.info.start_ns + round(since_start_s * 1e9)

    async def _decoded(
        self, keys: Sequence[str], start_s: float | None, end_s: float | None, wanted: str = ""
    ) -> AsyncIterator[tuple[Recorded, Message]]:
        """Yield channels' messages of the wanted schema; empty: of any schema.

        Raises:
            RecordingError: If they are too many for one result, or a time is out of range.
        """
        left_out = count = total = 0
        most = _MOST_BYTES + _MOST_TIMES_THE_FILE * self.info.bytes
        names = ", ".join(keys[:_MOST_NAMED])
        async for page in self._source.pages(keys, self._time_ns(start_s), self._time_ns(end_s)):
            for each in page.messages:
                count += 1
                total += len(each.data) + _MESSAGE_BYTES
                if total > most:
                    raise RecordingError(
                        f"{self.info.file}: its messages of {names} have more than {most >> 20} MiB: read "
                        "them one after the other, with `messages`"
                    )
                message = _decoded(page, each.data) if wanted in ("", page.schema) else None
                if message is None:
                    left_out += 1
                    continue
                if max(abs(each.source_ns), abs(each.received_ns)) > _LAST_NS:
                    raise RecordingError(f"{self.info.file}: a message of {names} has a time out of range")
                yield each, message
        self._warn(left_out, f"messages of {names} cannot be read: left out")
        # Merged recordings may count a message twice, which is read once.
        if start_s is None and end_s is None and not self.info.open and not self.info.merged_from:
            expected = sum(each.messages for each in self.info.topics if each.key in keys)
            self._warn(expected - count, f"of {expected} messages of {names} are missing")

    def _warn(self, count: int, what: str) -> None:
        if count > 0:
            log.warning("%s: %d %s", self.info.file, count, what)


def _decoded(page: Page, data: bytes) -> Message | None:
    if page.decode is None:
        return None
    try:
        return page.decode(data)
    except (DecodeError, ValueError):
        return None


def _parts(key: str) -> tuple[str, str, str]:
    try:
        return parse_key(key)
    except KeyNameError:
        return "", "", key.strip("/")
