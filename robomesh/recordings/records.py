"""Records of an MCAP file as bytes: packing, iteration, and the summary at the end of a file.

The library's writer takes 4 us for each message; this module packs one in less than 1 us and copies records
between files unchanged.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import IO

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

MAGIC = b"\x89MCAP0\r\n"
# Opcode and length of every record; a message's channel, sequence, log time, publish time.
RECORD = struct.Struct("<BQ")
MESSAGE = struct.Struct("<HIQQ")
_WHOLE_MESSAGE = struct.Struct("<BQHIQQ")
_FOOTER = struct.Struct("<BQQQ")
# A longer record is damaged: attachments and our chunks are smaller.
MOST_RECORD_BYTES = 256 << 20
# What all chunks of a file may unpack to: this, and a multiple of the file. States compress to a tenth.
_MOST_UNPACKED_BYTES, _MOST_TIMES_THE_FILE = MOST_RECORD_BYTES, 200
_READ_BYTES = 1 << 20
# Exceptions of the library for a truncated or modified file.
DAMAGE = (McapError, EOFError, struct.error, ValueError, KeyError, IndexError, OverflowError, MemoryError)


def start() -> bytes:
    """Return the first bytes of a file."""
    return MAGIC + record_bytes(Header(profile="", library="robomesh"))


def record_bytes(record: McapRecord) -> bytes:
    """Return the bytes of a record."""
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data


def message_head(channel: int, sequence: int, log_time: int, publish_time: int, size: int) -> bytes:
    """Return the head of a message with `size` bytes of payload; times in ns since the Unix epoch.

    The format has no earlier times: a negative publish time becomes 0.
    """
    return _WHOLE_MESSAGE.pack(
        Opcode.MESSAGE,
        MESSAGE.size + size,
        channel,
        sequence & 0xFFFFFFFF,  # the format has 32 bits
        log_time,
        max(publish_time, 0),
    )


def stream_of(body: bytes) -> ReadDataStream:
    """Return a record's body as a stream for the library."""
    return ReadDataStream(BytesIO(body))


def number_in(text: str) -> int:
    """Return the number in a metadata record, which another program may have written; 0 if it is invalid."""
    return int(text) if text.isdecimal() and len(text) < 10 else 0


def walk(stream: IO[bytes], begin: int = 0) -> Iterator[tuple[int, bytes, int]]:
    """Yield opcode, body and end [bytes from the file's beginning] of every complete record up to DATA_END.

    Stops before DATA_END if the file is truncated, or a record's length is invalid.

    Args:
        begin: Position of a record at which to begin; 0: the file's beginning.
    """
    stream.seek(begin)
    if not begin and stream.read(len(MAGIC)) != MAGIC:
        raise ValueError("not an MCAP file: its first bytes are wrong")
    buffer, at, end, head = b"", 0, begin or len(MAGIC), RECORD.size
    while True:
        if len(buffer) - at < head:
            buffer, at = buffer[at:] + stream.read(_READ_BYTES), 0
            if len(buffer) < head:
                return
        opcode, length = RECORD.unpack_from(buffer, at)
        if not opcode or length > MOST_RECORD_BYTES:
            return
        after = at + head + length
        if after > len(buffer):
            buffer, at, after = buffer[at:] + stream.read(max(length, _READ_BYTES)), 0, head + length
            if len(buffer) < after:
                return
        end += after - at
        yield opcode, buffer[at + head : after], end
        at = after
        if opcode == Opcode.DATA_END:
            return


def check_unpacked(unpacked: int, size: int) -> None:
    """Check the unpacked size of all chunks of a file [bytes]: a small file must not cost minutes.

    Raises:
        ValueError: If it is too large.
    """
    if unpacked > _MOST_UNPACKED_BYTES + _MOST_TIMES_THE_FILE * size:
        raise ValueError(f"its {size >> 10} KiB unpack to {unpacked >> 20} MiB, and are no recording")


def unpack_chunk(body: bytes, most: int = MOST_RECORD_BYTES) -> bytes:
    """Return the unpacked records of a chunk's body; uses no more memory than its declared, limited size.

    Args:
        most: Limit of that size [bytes].

    Raises:
        DAMAGE: One of these, if it cannot be unpacked, or its size or checksum is wrong.
    """
    chunk = Chunk.read(stream_of(body))
    size = chunk.uncompressed_size
    if size > most:
        raise ValueError(f"a chunk has {size >> 20} MiB: the limit is {most >> 20} MiB")
    try:
        data = _unpacked(chunk.compression, chunk.data, size + 1)
    except (zstandard.ZstdError, RuntimeError) as error:
        raise ValueError(f"a chunk cannot be unpacked: {error}") from None
    if len(data) != size:
        raise ValueError(f"a chunk does not have its declared size of {size} bytes")
    if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise ValueError("a chunk has a wrong checksum")
    return data


def _unpacked(compression: str, data: bytes, most: int) -> bytes:
    match compression:
        case "":
            return data
        case "zstd":
            # A stream reader limits the memory; otherwise the size in the zstd frame would decide.
            return zstandard.ZstdDecompressor().stream_reader(data).read(most)
        case "lz4":
            unpacked: bytes = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=most)
            return unpacked
    raise ValueError(f"a chunk has the unknown compression {compression!r}: zstd and lz4 are supported")


def walk_chunk(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and body of every record in an unpacked chunk.

    Raises:
        DAMAGE: One of these, at an invalid record.
    """
    at = 0
    while at < len(data):
        opcode, length = RECORD.unpack_from(data, at)
        at += RECORD.size
        if not opcode or length > len(data) - at:
            raise ValueError("a chunk contains an invalid record")
        yield opcode, data[at : at + length]
        at += length


@dataclass
class Contents:
    """Contents of a file for its summary. Offsets in bytes from the file's beginning."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    start_ns: int = 0
    end_ns: int = 0
    attachments: list[AttachmentIndex] = field(default_factory=list)
    metadata: list[MetadataIndex] = field(default_factory=list)
    chunks: list[ChunkIndex] = field(default_factory=list)

    def note_message(self, channel: int, log_time: int) -> None:
        """Count a message."""
        if not self.start_ns or log_time < self.start_ns:
            self.start_ns = log_time
        if log_time > self.end_ns:
            self.end_ns = log_time
        self.counts[channel] += 1

    def note(self, opcode: int, body: bytes, offset: int) -> None:
        """Add a record that begins at `offset`.

        Raises:
            DAMAGE: One of these, if it cannot be read.
        """
        length = RECORD.size + len(body)
        match opcode:
            case Opcode.MESSAGE:
                channel, _, log_time, _ = MESSAGE.unpack_from(body)
                self.note_message(channel, log_time)
            case Opcode.SCHEMA:
                schema = Schema.read(stream_of(body))
                self.schemas[schema.id] = schema
            case Opcode.CHANNEL:
                channel = Channel.read(stream_of(body))
                self.channels[channel.id] = channel
            case Opcode.METADATA:
                name = Metadata.read(stream_of(body)).name
                self.metadata.append(MetadataIndex(offset=offset, length=length, name=name))
            case Opcode.ATTACHMENT:
                each = Attachment.read(stream_of(body))
                self.attachments.append(
                    AttachmentIndex(
                        offset=offset,
                        length=length,
                        log_time=each.log_time,
                        create_time=each.create_time,
                        data_size=len(each.data),
                        name=each.name,
                        media_type=each.media_type,
                    )
                )

    def end(self, offset: int) -> bytes:
        """Return the bytes after the records, which end at `offset`: DATA_END, summary, footer."""
        head = record_bytes(DataEnd(0))
        begin = offset + len(head)
        summary = b""
        offsets: list[SummaryOffset] = []
        statistics = Statistics(
            attachment_count=len(self.attachments),
            channel_count=len(self.channels),
            channel_message_counts=dict(self.counts),
            chunk_count=len(self.chunks),
            message_count=self.counts.total(),
            message_end_time=self.end_ns,
            message_start_time=self.start_ns,
            metadata_count=len(self.metadata),
            schema_count=len(self.schemas),
        )
        groups: tuple[tuple[Opcode, list[McapRecord]], ...] = (
            (Opcode.SCHEMA, list(self.schemas.values())),
            (Opcode.CHANNEL, list(self.channels.values())),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, list(self.chunks)),
            (Opcode.ATTACHMENT_INDEX, list(self.attachments)),
            (Opcode.METADATA_INDEX, list(self.metadata)),
        )
        for opcode, records in groups:
            group = b"".join(map(record_bytes, records))
            if group:
                offsets.append(SummaryOffset(opcode, begin + len(summary), len(group)))
                summary += group
        offsets_begin = begin + len(summary)
        summary += b"".join(map(record_bytes, offsets))
        crc = zlib.crc32(_FOOTER.pack(Opcode.FOOTER, 20, begin, offsets_begin), zlib.crc32(summary))
        footer = Footer(summary_start=begin, summary_offset_start=offsets_begin, summary_crc=crc)
        return head + summary + record_bytes(footer) + MAGIC
