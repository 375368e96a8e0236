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
from robomesh.recordings.channel_names import ABOUT, LOST

_CHUNK_BYTES = 1 << 20


@dataclass
class Copied:
    """Counts and checksums of the copied data, to verify the new file.

    Attributes:
        cut: Number of sources that end in the middle of a record.
        damaged: Number of omitted chunks, which could not be unpacked.
    """

    messages: Counter[int] = field(default_factory=Counter)
    crc: int = 0
    attachments: dict[str, int] = field(default_factory=dict)
    cut: int = 0
    damaged: int = 0


class IndexedWriter:
    """The new file: its chunks and its summary."""

    def __init__(self, stream: IO[bytes], about: Mapping[str, str]) -> None:
        self.copied = Copied()
        self.about: dict[str, str] = {}
        self.lost: Counter[str] = Counter()
        self._more = about
        self._stream = stream
        self._contents = records.Contents()
        self._pack = zstandard.ZstdCompressor(level=3)
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._channels: dict[tuple[str, str, int], int] = {}
        self._chunk = bytearray()
        self._begun: set[int] = set()
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
            if found.schema_id:
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
        """Add an attachment; ignores a second one with the same name."""
        if found.name not in self.copied.attachments:
            self.copied.attachments[found.name] = zlib.crc32(found.data)
            self._end_chunk()
            self._record(records.record_bytes(found))

    def metadata(self, found: Metadata) -> None:
        """Add a metadata record; our own records are merged and written at the end."""
        if found.name == ABOUT:
            self.about = self.about or dict(found.metadata)
        elif found.name == LOST:
            self.lost.update({key: records.number_in(text) for key, text in found.metadata.items()})
        else:
            self._end_chunk()
            self._record(records.record_bytes(found))

    def finish(self) -> None:
        """Write the end of the file."""
        self._end_chunk()
        if self.about or self._more:
            self._record(records.record_bytes(Metadata(ABOUT, {**self.about, **self._more})))
            lost = {key: str(number) for key, number in self.lost.items() if number}
            self._record(records.record_bytes(Metadata(LOST, lost)))
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
