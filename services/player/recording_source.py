"""A recording as it is played: what was so at a time, and what came next, as the replay publishes it."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from google.protobuf.message import DecodeError

from mcap_files.publisher_time import PublisherTimes
from mcap_files.reading import RecordedMessage, RecordingFile
from mcap_files.video import holds_key_frame
from robomesh import reason_codes as codes
from robomesh import topics
from robomesh.errors import BusError
from robomesh.keys import Key, parse_key
from robomesh.publisher import LIST_LENGTH
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.topics import History
from services.player.errors import ReplayError
from services.player.republish import Names, renamed

# Of topics that come on change, so often at most while it is played fast.
_ON_CHANGE_HZ = 10.0
# Faster than this a video's pictures between key frames are left out: nobody could draw them all.
_EACH_PICTURE_UNTIL = 2.0
_MOST_AT_ONCE, _MOST_LOOKED_AT = 5000, 100_000
_MOST_BYTES = 8 << 20
_MOST_FRAMES = 300


class Played(NamedTuple):
    """A message that is ready to be published.

    Attributes:
        at_ns: When it was so by its publisher's clock, on the recording's time axis.
    """

    topic: str
    at_ns: int
    source_ns: int
    payload: bytes
    key_frame: bool


@dataclass
class Scene:
    """What was so at a time: the newest of each topic, its video's frames, its lists."""

    newest: list[Played] = field(default_factory=list)
    lists: dict[str, list[Played]] = field(default_factory=dict)


class Tape:
    """A recording being played. Its methods may block on the disk; one thread at a time.

    Raises:
        RecordingError: If the file cannot be read.
        ReplayError: If it is no recording of a robot.
    """

    def __init__(self, path: Path) -> None:
        self.file = RecordingFile(path)
        layout = self.file.layout
        self.start_ns, self.end_ns = layout.start_ns, layout.end_ns
        found = _topics_of_robot(self.file)
        if not found:
            self.file.close()
            raise ReplayError(codes.REPLAY_NO_ROBOT(file=path.name))
        first = next(iter(found.values()))
        self.of_site, self.of_robot = first.site, first.robot
        self._keys = {name: key.topic for name, key in found.items()}
        self._coming: Iterator[RecordedMessage] = iter(())
        self._taken: dict[str, int] = {}
        self._held: RecordedMessage | None = None
        self._times = PublisherTimes()
        self.names = Names(self.of_site, self.of_robot, self.of_site, self.of_robot)
        self.replay = schema.Description.Replay()

    @property
    def topics(self) -> list[str]:
        """The topics that are published."""
        return [self.names.topic(topic) for topic in self._keys.values()]

    def close(self) -> None:
        """Read no more."""
        self.file.close()

    def seek(self, at_ns: int) -> Scene:
        """Go to a time: what was so then; `take` goes on behind it.

        Raises:
            RecordingError: If the file is damaged there.
        """
        scene = Scene()
        plain = []
        self._times = PublisherTimes()
        for key, topic in self._keys.items():
            history = topics.topic(topic).history
            if history is History.LAST_100:
                scene.lists[topic] = [*self._stood(self.file.last(key, at_ns, LIST_LENGTH))]
            elif history is History.KEY_FRAME:
                scene.newest += self._stood(self._since_key_frame(key, at_ns))
            else:
                plain.append(key)
        newest = self.file.state_at(plain, at_ns)
        for key in plain:
            if key not in newest and self._keys[key] == "description":
                # What a robot is explains what came before it was told.
                newest[key] = next(self.file.messages([key]))
        scene.newest += self._stood(sorted(newest.values()))
        self._coming = self.file.messages([*self._keys], start_ns=at_ns + 1)
        self._taken, self._held = {}, None
        return scene

    def take(self, until_ns: int, *, speed: float) -> tuple[list[Played], int]:
        """Return what came next until a time, thinned to the topics' rates, and how far that goes.

        Raises:
            RecordingError: If the file is damaged there.
        """
        taken: list[tuple[int, RecordedMessage]] = []
        room, reached_ns = _MOST_BYTES, until_ns
        for _ in range(_MOST_LOOKED_AT):
            message = self._held or next(self._coming, None)
            self._held = None
            if message is None:
                return [*self._played(taken)], max(until_ns, self.end_ns)
            if message.received_ns > until_ns:
                self._held = message
                return [*self._played(taken)], until_ns
            reached_ns = message.received_ns
            at_ns = self._at_ns(message)
            if self._is_due(message, at_ns, speed):
                taken.append((at_ns, message))
                room -= len(message.data)
            if len(taken) >= _MOST_AT_ONCE or room < 0:
                break
        return [*self._played(taken)], reached_ns

    def _at_ns(self, message: RecordedMessage) -> int:
        # Nothing is played behind the end, whatever its publisher's clock said.
        return min(self._times.of(message), self.end_ns)

    def _is_due(self, message: RecordedMessage, at_ns: int, speed: float) -> bool:
        row = topics.topic(self._keys[message.topic])
        if speed <= 1.0 or row.history is History.LAST_100:
            return True
        if row.history is History.KEY_FRAME:
            return speed <= _EACH_PICTURE_UNTIL or holds_key_frame(message.data)
        gap_ns = 1e9 * speed / (row.rate_hz or _ON_CHANGE_HZ)
        before = self._taken.get(message.topic)
        # A little early is in time: what comes at just that rate must not lose every second one.
        if before is not None and at_ns - before < 0.9 * gap_ns:
            return False
        self._taken[message.topic] = at_ns
        return True

    def _since_key_frame(self, key: str, at_ns: int) -> list[RecordedMessage]:
        first = self.file.newest(key, at_ns, holds_key_frame)
        if first is None:
            return []
        coming = self.file.messages([key], start_ns=first.received_ns, end_ns=at_ns + 1)
        return [message for message, _ in zip(coming, range(_MOST_FRAMES), strict=False)]

    def _stood(self, messages: list[RecordedMessage]) -> Iterator[Played]:
        return self._played([(self._at_ns(message), message) for message in messages])

    def _played(self, messages: list[tuple[int, RecordedMessage]]) -> Iterator[Played]:
        for at_ns, message in messages:
            topic = self._keys[message.topic]
            try:
                payload = renamed(topic, message.data, self.names, self.replay)
            except DecodeError:
                continue  # one message that somebody's program wrote wrong spoils no replay
            is_video = topics.topic(topic).history is History.KEY_FRAME
            yield Played(
                self.names.topic(topic),
                at_ns,
                message.source_ns,
                payload,
                is_video and holds_key_frame(payload),
            )


def _topics_of_robot(file: RecordingFile) -> dict[str, Key]:
    """The channels of the mesh's recorded topics, of the first robot in the file."""
    found: dict[str, Key] = {}
    for name in sorted(file.topics):
        try:
            key = parse_key(name)
            row = topics.topic(key.topic)
        except BusError:
            continue
        whose = next(iter(found.values()), key)
        same = (key.site, key.robot) == (whose.site, whose.robot)
        if (
            same
            and key.robot != "-"
            and row.recorded
            and file.schema_name(name) == row.schema.DESCRIPTOR.full_name
        ):
            found[name] = key
    return found
