"""Writer of an indexed recording: 1 MiB zstd chunks, a message index, attachments, metadata."""

import zlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import IO

import zstandard
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, ChunkIndex, MessageIndex, Metadata, Schema

from robomesh.recordings import records
from robomesh.recordings.metadata import about_name, end_record, is_about, is_end, lost_in

_CHUNK_BYTES = 1 << 20


@dataclass
class Copied:
    """Counts and checksums of the copied data, to verify the new file.

    Attributes:
        attachments: Their names and checksums.
        cut: Number of sources that end in the middle of a record.
        damaged: Number of omitted chunks, which could not be unpacked.
    """

    messages: Counter[int] = field(default_factory=Counter)
    crc: int = 0
    attachments: set[tuple[str, int]] = field(default_factory=set)
    cut: int = 0
    damaged: int = 0


class IndexedWriter:
    """The new file: its chunks and its summary.

    Args:
        about: Additions and changes to what its recordings say of themselves.
        file: Name for a recording that has none, without ending.
        joined: The sources are consecutive pieces of one recording, which has the first one's name.
    """

    def __init__(
        self, stream: IO[bytes], about: Mapping[str, str], *, file: str, joined: bool = False
    ) -> None:
        self.copied = Copied()
        # Names of the metadata at the beginning of each recording; the metadata at their ends.
        self.recordings: list[str] = []
        self._ends: list[Metadata] = []
        # Lost publications that no metadata counts, by topic.
        self.lost: Counter[str] = Counter()
        self._more, self._file, self._joined = about, file, joined
        self._stream = stream
        self._contents = records.Contents()
        self._pack = zstandard.ZstdCompressor(level=3)
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._channels: dict[tuple[str, str, int], int] = {}
        self._chunk = bytearray()
        # Channels and schemas whose records are written; 0: a channel has no schema.
        self._begun: set[int] = set()
        self._begun_schemas = {0}
        self._places: dict[int, list[tuple[int, int]]] = {}
        self._end = 0
        # Number and time of each channel's last message.
        self.newest: dict[int, tuple[int, int]] = {}
        self._put(records.start())

    def topic(self, channel: int) -> str:
        """Return the topic of a channel."""
        return self._contents.channels[channel].topic

    def schema(self, found: Schema) -> int:
        """Return a schema's id in this file."""
        return self._schemas.setdefault((found.name, found.encoding, found.data), len(self._schemas) + 1)

    def channel(self, found: Channel, schema_id: int, schema: Schema | None) -> int:
        """Return a channel's id in this file."""
        key = (found.topic, found.message_encoding, schema_id)
        number = self._channels.get(key)
        if number is None:
            number = self._channels[key] = len(self._channels) + 1
            self._contents.channels[number] = Channel(
                id=number,
                topic=found.topic,
                message_encoding=found.message_encoding,
                schema_id=schema_id,
                metadata=found.metadata,
            )
            if schema is not None:
                self._contents.schemas[schema_id] = Schema(
                    id=schema_id, data=schema.data, encoding=schema.encoding, name=schema.name
                )
        return number

    def message(self, channel: int, log_time: int, body: bytes) -> None:
        """Add a message with this file's channel id in its body."""
        if channel not in self._begun:
            # A stream reader needs the channel and its schema before their first message.
            self._begun.add(channel)
            found = self._contents.channels[channel]
            if found.schema_id not in self._begun_schemas:
                self._begun_schemas.add(found.schema_id)
                self._chunk += records.record_bytes(self._contents.schemas[found.schema_id])
            self._chunk += records.record_bytes(found)
        self._places.setdefault(channel, []).append((log_time, len(self._chunk)))
        self._chunk += records.RECORD.pack(Opcode.MESSAGE, len(body))
        self._chunk += body
        self._contents.note_message(channel, log_time)
        self.copied.messages[channel] += 1
        self.copied.crc = zlib.crc32(body, self.copied.crc)
        if len(self._chunk) >= _CHUNK_BYTES:
            self._end_chunk()

    def attachment(self, found: Attachment) -> None:
        """Add an attachment; ignores one that is already there."""
        attachment = found.name, zlib.crc32(found.data)
        if attachment not in self.copied.attachments:
            self.copied.attachments.add(attachment)
            self._end_chunk()
            self._record(records.record_bytes(found))

    def metadata(self, found: Metadata) -> None:
        """Add a metadata record; those at a recording's end are written at the end of the file."""
        if is_end(found.name):
            self._ends.append(found)
            return
        if is_about(found.name):
            if self.recordings and self._joined:
                return
            self.recordings.append(found.name)
            found = Metadata(found.name, {**found.metadata, **self._more})
        self._end_chunk()
        self._record(records.record_bytes(found))

    def finish(self) -> None:
        """Write the end of the file."""
        self._end_chunk()
        if not self.recordings and self._more:
            self.metadata(Metadata(about_name("", "", self._file), {}))
        ends = self._ends
        if len(self.recordings) == 1:
            lost = self.lost + lost_in(ends)
            ends = [end_record(self.recordings[0], self._contents.end_ns, lost)]
        for each in ends:
            self._record(records.record_bytes(each))
        self._put(self._contents.end(self._end))

    def _end_chunk(self) -> None:
        if not self._places:
            return
        data, places = bytes(self._chunk), self._places
        self._chunk, self._places = bytearray(), {}
        times = [time for each in places.values() for time, _ in each]
        packed = self._pack.compress(data)
        offset = self._end
        chunk = Chunk(
            compression="zstd",
            data=packed,
            message_start_time=min(times),
            message_end_time=max(times),
            uncompressed_crc=zlib.crc32(data),
            uncompressed_size=len(data),
        )
        self._put(records.record_bytes(chunk))
        length = self._end - offset
        offsets: dict[int, int] = {}
        for channel, each in places.items():
            offsets[channel] = self._end
            self._put(records.record_bytes(MessageIndex(channel_id=channel, records=each)))
        self._contents.chunks.append(
            ChunkIndex(
                chunk_length=length,
                chunk_start_offset=offset,
                compression="zstd",
                compressed_size=len(packed),
                message_end_time=chunk.message_end_time,
                message_index_length=self._end - offset - length,
                message_index_offsets=offsets,
                message_start_time=chunk.message_start_time,
                uncompressed_size=len(data),
            )
        )

    def _record(self, data: bytes) -> None:
        self._contents.note(data[0], data[records.RECORD.size :], self._end)
        self._put(data)

    def _put(self, data: bytes) -> None:
        self._stream.write(data)
        self._end += len(data)
