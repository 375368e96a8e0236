"""A part of a recording, the names of its topics, and its description of the robot."""

from typing import NamedTuple, TypeVar

from google.protobuf.message import DecodeError, Message

from robomesh.recordings.names import robot_channels
from robomesh.recordings.reading import RecordingFile
from robomesh.schemas import robomesh_pb2 as schema
from services.export.errors import ExportError

M = TypeVar("M", bound=Message)


class Span(NamedTuple):
    """A part of a recording [ns since the Unix epoch], the end included."""

    start_ns: int
    end_ns: int

    def share(self, time_ns: int) -> float:
        """Return the position of a time in the span, from 0 to 1."""
        return min(max((time_ns - self.start_ns) / max(self.end_ns - self.start_ns, 1), 0.0), 1.0)


def span_of(file: RecordingFile, begin_s: float, end_s: float | None) -> Span:
    """Return the span between two times since the recording's start.

    Raises:
        ExportError: If the times are outside of the recording, or reversed.
    """
    first, last = file.layout.start_ns, file.layout.end_ns
    duration_s = (last - first) * 1e-9
    until_s = duration_s if end_s is None else min(end_s, duration_s)
    if not 0.0 <= begin_s <= until_s:
        asked = f"--from {begin_s:g}" + ("" if end_s is None else f" --to {end_s:g}")
        raise ExportError(f"{asked}: {file.path.name} goes from 0 to {duration_s:.3f} s")
    return Span(first + round(begin_s * 1e9), last if end_s is None else first + round(until_s * 1e9))


def topics_of(file: RecordingFile) -> dict[str, str]:
    """Return the robot's topics by their name below the robot, with their keys in the file.

    Raises:
        RecordingError: If several robots have messages.
    """
    return robot_channels(file.layout.messages, file.path.name)


def needed(file: RecordingFile, topic: str) -> str:
    """A topic's name in the file.

    Raises:
        ExportError: If nothing of it is recorded.
    """
    topics = topics_of(file)
    if topic not in topics:
        raise ExportError(
            f"{file.path.name}: no {topic} in it; it has {', '.join(topics) or 'no robot topic'}"
        )
    return topics[topic]


def decoded(kind: type[M], data: bytes) -> M | None:
    """Decode a recorded message; None: the message is invalid, and the others remain usable."""
    try:
        return kind.FromString(data)
    except DecodeError:
        return None


def description_of(file: RecordingFile) -> schema.Description | None:
    """Return the robot's description; None: the recording has none."""
    topic = topics_of(file).get("description")
    newest = None if topic is None else file.newest(topic, file.layout.end_ns)
    return None if newest is None else decoded(schema.Description, newest.data)
