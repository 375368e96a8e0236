"""A capture: one robot's recorded topics into one MCAP file.

While it is open the file is unchunked, so that a reader of the stream gets every whole message of
a file whose writer was killed. When it is closed it is written again in indexed 1 MiB chunks,
compared, and renamed over the live one.
"""

import contextlib
import os
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.writer import Writer
from mcap_protobuf.schema import build_file_descriptor_set

from bus.header import Header
from bus.topics import Topic
from services.errors import ServiceError

# Metadata records of ours in a file.
ABOUT = "robomesh"
LOST = "robomesh.lost"
_PROFILE = ""
_LIBRARY = "robomesh"
# Ending of a file that is being written again.
INDEXING = ".indexing"


class CaptureError(ServiceError):
    """A capture that cannot be written."""


@dataclass
class Capture:
    """An open capture. Its methods may block on the disk."""

    site: str
    robot: str
    name: str
    started_by: str
    path: Path
    start_ns: int
    counts: Counter[str] = field(default_factory=Counter)
    _stream: IO[bytes] = field(init=False)
    _writer: Writer = field(init=False)
    _channels: dict[str, int] = field(default_factory=dict)
    _schemas: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._stream = self.path.open("xb")
        except OSError as error:
            raise CaptureError(f"{self.path}: cannot be written: {error.strerror}") from None
        self._writer = Writer(self._stream, use_chunking=False)
        self._writer.start(profile=_PROFILE, library=_LIBRARY)
        about = {"site": self.site, "robot": self.robot, "name": self.name, "started_by": self.started_by}
        self._writer.add_metadata(ABOUT, about)

    def add(self, key: str, topic: Topic, header: Header, payload: bytes, *, received_ns: int) -> None:
        """Write a publication of a topic as it came.

        Args:
            received_ns: When, ns since the Unix epoch.
        """
        channel = self._channels.get(key)
        if channel is None:
            channel = self._channels[key] = self._register(key, topic)
        self._writer.add_message(
            channel_id=channel,
            log_time=received_ns,
            publish_time=header.source_time_ns,
            data=payload,
            # The format has 32 bits.
            sequence=header.sequence & 0xFFFFFFFF,
        )
        self.counts[key] += 1

    def flush(self, *, sync: bool) -> None:
        """Hand what was written to the system, and with `sync` to the disk."""
        self._stream.flush()
        if sync:
            os.fsync(self._stream.fileno())

    def finish(self, missed: dict[str, int]) -> None:
        """Close the file; afterwards it is whole.

        Args:
            missed: Publications that are not in it, by key.
        """
        self._writer.add_metadata(LOST, {key: str(number) for key, number in missed.items() if number})
        self._writer.finish()
        self.flush(sync=True)
        self._stream.close()

    def abandon(self) -> None:
        """Close the file as it is; the disk takes no more."""
        with contextlib.suppress(OSError):
            self._stream.close()

    def _register(self, key: str, topic: Topic) -> int:
        descriptor = topic.schema.DESCRIPTOR
        if descriptor.full_name not in self._schemas:
            self._schemas[descriptor.full_name] = self._writer.register_schema(
                name=descriptor.full_name,
                encoding="protobuf",
                data=build_file_descriptor_set(topic.schema).SerializeToString(),
            )
        return self._writer.register_channel(
            topic=key, message_encoding="protobuf", schema_id=self._schemas[descriptor.full_name]
        )


def index(path: Path) -> None:
    """Write a finished file again, in 1 MiB zstd chunks with an index; it stays when anything differs.

    Raises:
        CaptureError: If the new one is not the same.
        OSError: If the disk refuses.
    """
    new = path.with_suffix(INDEXING)
    try:
        with path.open("rb") as source, new.open("wb") as target:
            writer = Writer(target)
            writer.start(profile=_PROFILE, library=_LIBRARY)
            written = _copy(source, writer)
            writer.finish()
            target.flush()
            os.fsync(target.fileno())
        with new.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        if summary is None or summary.statistics is None or summary.statistics.message_count != written:
            raise CaptureError(f"{path}: not the same after indexing; kept as it was written")
        new.replace(path)
    finally:
        with contextlib.suppress(FileNotFoundError):
            new.unlink()


def _copy(source: IO[bytes], writer: Writer) -> int:
    from mcap.records import Channel, DataEnd, Message, Metadata, Schema

    schemas: dict[int, int] = {0: 0}
    channels: dict[int, int] = {}
    written = 0
    for record in StreamReader(source).records:
        match record:
            case Schema():
                schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
            case Channel():
                channels[record.id] = writer.register_channel(
                    record.topic, record.message_encoding, schemas[record.schema_id], record.metadata
                )
            case Message():
                writer.add_message(
                    channels[record.channel_id],
                    record.log_time,
                    record.data,
                    record.publish_time,
                    record.sequence,
                )
                written += 1
            case Metadata():
                writer.add_metadata(record.name, record.metadata)
            case DataEnd():
                break
    return written
