"""What is in the recorder's folder, told from the files themselves."""

import struct
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from google.protobuf.duration_pb2 import Duration
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Message, Metadata
from mcap.stream_reader import StreamReader

from bus.schemas import robomesh_pb2 as schema
from services.errors import ServiceError
from services.recorder.capture import ABOUT, LOST

SUFFIX = ".mcap"
# What the library raises, besides its own errors, where a file was cut or its bytes were changed.
_DAMAGE = (McapError, EOFError, struct.error, ValueError, KeyError, IndexError, OverflowError, MemoryError)


class RecordingError(ServiceError):
    """A file that is no recording."""


@dataclass(frozen=True)
class _Content:
    about: dict[str, str]
    lost: dict[str, int]
    counts: dict[str, int]
    start_ns: int
    end_ns: int
    whole: bool


def describe_file(path: Path) -> schema.Recording:
    """What a recording holds; a file whose writer was killed is read as far as it goes.

    Raises:
        RecordingError: If it cannot be read at all.
    """
    try:
        found = path.stat()
        content = _content(path, found.st_size, found.st_mtime_ns)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
    recording = schema.Recording(
        site=content.about.get("site", ""),
        robot=content.about.get("robot", ""),
        name=content.about.get("name", path.stem),
        started_by=content.about.get("started_by", ""),
        file=path.name,
        start=_timestamp(content.start_ns),
        duration=_duration(content.end_ns - content.start_ns),
        bytes=found.st_size,
        problem="" if content.whole else "its writer was killed: it reads up to there",
    )
    for topic in sorted({*content.counts, *content.lost}):
        recording.topics.add(
            topic=topic, messages=content.counts.get(topic, 0), lost=content.lost.get(topic, 0)
        )
    return recording


@lru_cache(maxsize=4096)
def _content(path: Path, size: int, mtime_ns: int) -> _Content:
    """What a file holds, read once for each state that it was in.

    Raises:
        RecordingError: If it cannot be read at all.
    """
    return _indexed(path) or _streamed(path)


def _indexed(path: Path) -> _Content | None:
    """From the summary at the end; None: there is none that can be read."""
    with path.open("rb") as stream:
        try:
            reader = make_reader(stream)
            summary = reader.get_summary()
            if summary is None or summary.statistics is None:
                return None
            metadata = {record.name: record.metadata for record in reader.iter_metadata()}
            statistics = summary.statistics
            return _Content(
                about=metadata.get(ABOUT, {}),
                lost={key: int(number) for key, number in metadata.get(LOST, {}).items()},
                counts={
                    summary.channels[channel].topic: number
                    for channel, number in statistics.channel_message_counts.items()
                },
                start_ns=statistics.message_start_time,
                end_ns=statistics.message_end_time,
                whole=True,
            )
        except _DAMAGE:
            return None


def _streamed(path: Path) -> _Content:
    """As far as the records of a file without a summary go."""
    about: dict[str, str] = {}
    channels: dict[int, str] = {}
    counts: dict[str, int] = {}
    first = last = 0
    with path.open("rb") as stream:
        try:
            for record in StreamReader(stream).records:
                match record:
                    case Metadata() if record.name == ABOUT:
                        about = record.metadata
                    case Channel():
                        channels[record.id] = record.topic
                    case Message():
                        topic = channels[record.channel_id]
                        counts[topic] = counts.get(topic, 0) + 1
                        first, last = first or record.log_time, record.log_time
        except _DAMAGE as error:
            if not about and not counts:
                raise RecordingError(f"{path}: no recording that can be read: {error}") from None
    return _Content(about, {}, counts, first, last, whole=False)


def _timestamp(nanoseconds: int) -> Timestamp:
    timestamp = Timestamp()
    timestamp.FromNanoseconds(nanoseconds)
    return timestamp


def _duration(nanoseconds: int) -> Duration:
    duration = Duration()
    duration.FromNanoseconds(max(nanoseconds, 0))
    return duration
