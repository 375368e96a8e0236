"""Messages of a recording for a replay: the state at a time, and the messages that follow it."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from google.protobuf.message import DecodeError

from robomesh import reason_codes as codes
from robomesh.contract import topics
from robomesh.contract.keys import parse_key
from robomesh.contract.topics import History
from robomesh.errors import RobomeshError
from robomesh.publications.publisher import LIST_LENGTH
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.h264 import holds_key_frame
from robomesh.recordings.names import robot_channels
from robomesh.recordings.reading import RecordedMessage, RecordingFile
from robomesh.recordings.series.publisher_time import PublisherTimes
from robomesh.schemas import robomesh_pb2 as schema
from services.player.errors import ReplayError
from services.player.republish import NameMapping, renamed

# Rate limit of topics that are published on change, during fast replay.
_ON_CHANGE_HZ = 10.0
# At higher speeds only a video's key frames are played, because a viewer cannot decode all frames in time.
_ALL_FRAMES_UP_TO = 2.0
_MAX_BATCH, _MAX_SCANNED = 5000, 100_000
_MAX_BATCH_BYTES = 8 << 20
_MAX_FRAMES = 300


class ReplayMessage(NamedTuple):
    """A message that is ready to be published.

    Attributes:
        at_ns: Time by its publisher's clock, converted to the recording's time axis.
    """

    topic: str
    at_ns: int
    source_ns: int
    payload: bytes
    key_frame: bool


@dataclass
class Snapshot:
    """State at a time: the newest message of each topic, video frames since a key frame, and lists."""

    newest: list[ReplayMessage] = field(default_factory=list)
    lists: dict[str, list[ReplayMessage]] = field(default_factory=dict)


class RecordingSource:
    """A recording that is being played. Methods may block on the disk; not thread-safe.

    Raises:
        RecordingError: If the file cannot be read, or contains several robots.
        ReplayError: If it contains no robot.
    """

    def __init__(self, path: Path) -> None:
        self.file = RecordingFile(path)
        layout = self.file.layout
        self.start_ns, self.end_ns = layout.start_ns, layout.end_ns
        try:
            self._keys = _topics_of_robot(self.file)
        except (RecordingError, ReplayError):
            self.file.close()
            raise
        self.of_site, self.of_robot, _ = parse_key(next(iter(self._keys)))
        self._upcoming: Iterator[RecordedMessage] = iter(())
        self._taken: dict[str, int] = {}
        self._pending: RecordedMessage | None = None
        self._times = PublisherTimes()
        self.names = NameMapping(self.of_site, self.of_robot, self.of_site, self.of_robot)
        self.replay = schema.Description.Replay()

    @property
    def topics(self) -> list[str]:
        """Topics that the replay publishes."""
        return [self.names.topic(topic) for topic in self._keys.values()]

    def close(self) -> None:
        """Close the file."""
        self.file.close()

    def seek(self, at_ns: int) -> Snapshot:
        """Return the state at a time; `take` continues after it.

        Raises:
            RecordingError: If the file is damaged there.
        """
        snapshot = Snapshot()
        plain = []
        self._times = PublisherTimes()
        for key, topic in self._keys.items():
            history = topics.topic(topic).history
            if history is History.LAST_100:
                snapshot.lists[topic] = [*self._at_time(self.file.last(key, at_ns, LIST_LENGTH))]
            elif history is History.KEY_FRAME:
                snapshot.newest += self._at_time(self._since_key_frame(key, at_ns))
            else:
                plain.append(key)
        newest = self.file.state_at(plain, at_ns)
        for key in plain:
            if key not in newest and self._keys[key] == "description":
                # The description also applies to messages before it.
                newest[key] = next(self.file.messages([key]))
        snapshot.newest += self._at_time(sorted(newest.values()))
        self._upcoming = self.file.messages([*self._keys], start_ns=at_ns + 1)
        self._taken, self._pending = {}, None
        return snapshot

    def take(self, until_ns: int, *, speed: float) -> tuple[list[ReplayMessage], int]:
        """Return the next messages until a time, thinned to the topics' rates, and the time reached.

        Raises:
            RecordingError: If the file is damaged there.
        """
        taken: list[tuple[int, RecordedMessage]] = []
        room, reached_ns = _MAX_BATCH_BYTES, until_ns
        for _ in range(_MAX_SCANNED):
            message = self._pending or next(self._upcoming, None)
            self._pending = None
            if message is None:
                return [*self._played(taken)], max(until_ns, self.end_ns)
            if message.received_ns > until_ns:
                self._pending = message
                return [*self._played(taken)], until_ns
            reached_ns = message.received_ns
            at_ns = self._at_ns(message)
            if self._is_due(message, at_ns, speed):
                taken.append((at_ns, message))
                room -= len(message.data)
            if len(taken) >= _MAX_BATCH or room < 0:
                break
        return [*self._played(taken)], reached_ns

    def _at_ns(self, message: RecordedMessage) -> int:
        # A publisher's clock may be ahead; no message is played after the end.
        return min(self._times.of(message), self.end_ns)

    def _is_due(self, message: RecordedMessage, at_ns: int, speed: float) -> bool:
        row = topics.topic(self._keys[message.topic])
        if speed <= 1.0 or row.history is History.LAST_100:
            return True
        if row.history is History.KEY_FRAME:
            return speed <= _ALL_FRAMES_UP_TO or holds_key_frame(message.data)
        gap_ns = 1e9 * speed / (row.rate_hz or _ON_CHANGE_HZ)
        before = self._taken.get(message.topic)
        # A tolerance for jitter: a topic at exactly this rate must not lose every second message.
        if before is not None and at_ns - before < 0.9 * gap_ns:
            return False
        self._taken[message.topic] = at_ns
        return True

    def _since_key_frame(self, key: str, at_ns: int) -> list[RecordedMessage]:
        first = self.file.newest(key, at_ns, holds_key_frame)
        if first is None:
            return []
        coming = self.file.messages([key], start_ns=first.received_ns, end_ns=at_ns + 1)
        return [message for message, _ in zip(coming, range(_MAX_FRAMES), strict=False)]

    def _at_time(self, messages: list[RecordedMessage]) -> Iterator[ReplayMessage]:
        return self._played([(self._at_ns(message), message) for message in messages])

    def _played(self, messages: list[tuple[int, RecordedMessage]]) -> Iterator[ReplayMessage]:
        for at_ns, message in messages:
            topic = self._keys[message.topic]
            try:
                payload = renamed(topic, message.data, self.names, self.replay)
            except DecodeError:
                continue  # skip an invalid message instead of ending the replay
            is_video = topics.topic(topic).history is History.KEY_FRAME
            yield ReplayMessage(
                self.names.topic(topic),
                at_ns,
                message.source_ns,
                payload,
                is_video and holds_key_frame(payload),
            )


def _topics_of_robot(file: RecordingFile) -> dict[str, str]:
    """Return the robot's channels that the recorder records, with their topics.

    Raises:
        RecordingError: If several robots have messages.
        ReplayError: If there is none.
    """
    found: dict[str, str] = {}
    for topic, channel in robot_channels(file.layout.messages, file.path.name).items():
        try:
            row = topics.topic(topic)
        except RobomeshError:
            continue
        if row.recorded and file.schema_name(channel) == row.schema.DESCRIPTOR.full_name:
            found[channel] = topic
    if not found:
        raise ReplayError(codes.REPLAY_NO_ROBOT(file=file.path.name))
    return found
