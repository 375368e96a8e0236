"""Positions of the messages in a file, without decoding them.

A closed file has them in its summary. A file that is still being written, or whose writer was killed, is
scanned once; its unchunked records are grouped into blocks of about 1 MiB.
"""

import contextlib
import struct
import threading
from collections import Counter, OrderedDict
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import IO, NamedTuple

from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, ChunkIndex, Metadata, Schema
from mcap.summary import Summary

from robomesh import reason_codes as codes
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.metadata import OneRecording, recordings_in, shared_entries
from robomesh.recordings.records import (
    DAMAGE,
    MAGIC,
    MESSAGE,
    MOST_RECORD_BYTES,
    RECORD,
    check_unpacked,
    stream_of,
    unpack_chunk,
    walk,
    walk_chunk,
)

_BLOCK_BYTES = 1 << 20
# A chunk with more channels is read whatever is asked for: layouts are kept, and may have many chunks.
_MOST_LISTED = 4096
# Metadata of ours is shorter; layouts are kept.
_MOST_METADATA_BYTES = 1 << 20
_ATTACHMENT = struct.Struct("<QQ")
_LENGTH = struct.Struct("<I")
# Head of a chunk: start and end time, unpacked size, checksum.
_CHUNK = struct.Struct("<QQQI")
# Scans of growing files that are kept, to continue at their last position.
_MOST_SCANS = 64
# Bytes before that position, compared to detect a file that was rewritten.
_COMPARED_BYTES = 4096


class Block(NamedTuple):
    """Consecutive messages: a chunk, or a range of unchunked records.

    Attributes:
        channels: Channels with messages in the block; None: unknown.
        chunk: The block is a chunk, which must be unpacked.
        unpacked: Its size when it is unpacked, at most [bytes].
    """

    start_ns: int
    end_ns: int
    offset: int
    length: int
    channels: frozenset[int] | None
    chunk: bool
    unpacked: int = 0


class Attached(NamedTuple):
    """An attachment's type and the position of its bytes in the file."""

    media_type: str
    offset: int
    length: int


@dataclass(frozen=True)
class Layout:
    """Blocks and other contents of a file, blocks in order of time.

    Attributes:
        counts: Number of messages of each channel.
        whole: The file was closed and has a summary.
    """

    channels: dict[int, Channel]
    counts: dict[int, int]
    schemas: dict[int, Schema]
    blocks: tuple[Block, ...]
    attachments: dict[str, Attached]
    metadata: tuple[Metadata, ...]
    start_ns: int
    end_ns: int
    whole: bool

    @cached_property
    def messages(self) -> dict[str, int]:
        """Number of messages by channel name; a name may have several channels."""
        found: dict[str, int] = {}
        for number, channel in self.channels.items():
            found[channel.topic] = found.get(channel.topic, 0) + self.counts.get(number, 0)
        return found

    @cached_property
    def recordings(self) -> tuple[OneRecording, ...]:
        """The recordings in the file: several, if it was merged; none, if another program wrote it."""
        return recordings_in(self.metadata)

    @cached_property
    def about(self) -> dict[str, str]:
        """What its recordings say of themselves, if they agree: site, robot, name, ..."""
        return shared_entries(self.recordings)


def layout_of(path: Path) -> Layout:
    """Return a file's layout; cached until the file changes.

    Raises:
        RecordingError: If it cannot be read.
    """
    try:
        found = path.stat()
        return _layout_of(path, found.st_ino, found.st_size, found.st_mtime_ns)
    except OSError as error:
        raise RecordingError(codes.RECORDING_FILE(file=path.name, detail=error.strerror)) from None


@lru_cache(maxsize=256)
def _layout_of(path: Path, inode: int, size: int, mtime_ns: int) -> Layout:
    with path.open("rb") as stream:
        if stream.read(len(MAGIC)) != MAGIC:
            raise RecordingError(codes.RECORDING_NOT_MCAP(file=path.name))
        try:
            stream.seek(0)
            reader = make_reader(stream)
            summary = reader.get_summary()
            if summary is not None and summary.statistics is not None and summary.chunk_indexes:
                return _indexed(summary, _metadata_of(stream, summary, size), size)
        except DAMAGE:
            pass  # the end is missing or damaged, but the rest may be readable
        try:
            return _scans.layout(path, inode, stream, whole=_ends_whole(path, size))
        except DAMAGE as error:
            raise RecordingError(f"{path.name}: not a readable recording: {error}") from None


def _metadata_of(stream: IO[bytes], summary: Summary, size: int) -> tuple[Metadata, ...]:
    """Return the metadata records that a file's summary lists; each once, however often it is listed.

    Raises:
        DAMAGE: One of these, if a record cannot be read.
    """
    found: list[Metadata] = []
    offsets = dict.fromkeys(each.offset for each in summary.metadata_indexes)
    for offset in offsets:
        stream.seek(offset)
        opcode, length = RECORD.unpack(stream.read(RECORD.size))
        size -= length
        if opcode != Opcode.METADATA or size < 0:
            raise ValueError("the summary lists invalid metadata")
        if length <= _MOST_METADATA_BYTES:
            found.append(Metadata.read(stream_of(stream.read(length))))
    return tuple(found)


def _indexed(summary: Summary, metadata: tuple[Metadata, ...], size: int) -> Layout:
    """Return the layout in a file's summary, which another program may have written.

    Raises:
        ValueError: If the summary is inconsistent.
    """
    assert summary.statistics is not None
    blocks = [_block_of(chunk, size) for chunk in summary.chunk_indexes]
    end = 0
    for block in sorted(blocks, key=lambda block: block.offset):
        if block.offset < end:
            raise ValueError("the summary lists a chunk twice")
        end = block.offset + block.length
    check_unpacked(sum(block.unpacked for block in blocks), size)
    # Only the times of chunks decide what is read: other programs' statistics may be incomplete.
    filled = [block for block in blocks if block.end_ns]
    attachments = {}
    for each in summary.attachment_indexes:
        begin = each.offset + each.length - 4 - each.data_size
        if not 0 <= begin <= size - each.data_size:
            raise ValueError(f"the position of attachment {each.name!r} is outside the file")
        attachments[each.name] = Attached(each.media_type, begin, each.data_size)
    return Layout(
        channels=summary.channels,
        counts=dict(summary.statistics.channel_message_counts),
        schemas=summary.schemas,
        blocks=tuple(sorted(blocks)),
        attachments=attachments,
        metadata=metadata,
        start_ns=min((block.start_ns for block in filled), default=0),
        end_ns=max((block.end_ns for block in filled), default=0),
        whole=True,
    )


def _block_of(chunk: ChunkIndex, size: int) -> Block:
    if chunk.uncompressed_size > MOST_RECORD_BYTES or chunk.chunk_length > MOST_RECORD_BYTES:
        mib = max(chunk.uncompressed_size, chunk.chunk_length) >> 20
        raise RecordingError(codes.RECORDING_CHUNK(mib=mib, most=MOST_RECORD_BYTES >> 20))
    if chunk.chunk_start_offset + chunk.chunk_length > size:
        raise ValueError("the position of a chunk is outside the file")
    return Block(
        chunk.message_start_time,
        chunk.message_end_time,
        chunk.chunk_start_offset,
        chunk.chunk_length,
        frozenset(listed) if 0 < len(listed := chunk.message_index_offsets) <= _MOST_LISTED else None,
        chunk=True,
        unpacked=chunk.uncompressed_size,
    )


def _ends_whole(path: Path, size: int) -> bool:
    with path.open("rb") as stream:
        stream.seek(max(size - len(MAGIC), 0))
        return size > 2 * len(MAGIC) and stream.read(len(MAGIC)) == MAGIC


class _Scan:
    """The scan of a file so far."""

    def __init__(self) -> None:
        self.channels: dict[int, Channel] = {}
        self.counts: Counter[int] = Counter()
        self.schemas: dict[int, Schema] = {}
        self.blocks: list[Block] = []
        self.attachments: dict[str, Attached] = {}
        self.metadata: list[Metadata] = []
        # The current block of unchunked messages.
        self.begin = self.end = 0
        self.unpacked = 0
        self.start_ns, self.end_ns = 0, 0
        self.seen: set[int] = set()
        # Position up to which the file is scanned, and the bytes before it.
        self.offset = len(MAGIC)
        self.before = b""

    def covers(self, stream: IO[bytes]) -> bool:
        """Return whether the file is the scanned one, possibly with appended data."""
        stream.seek(self.offset - len(self.before))
        return stream.read(len(self.before)) == self.before

    def scan_appended(self, stream: IO[bytes]) -> None:
        """Scan the data appended since the last call.

        Raises:
            DAMAGE: One of these, if a record cannot be read.
        """
        for opcode, body, end in walk(stream, self.offset):
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                break
            if opcode == Opcode.MESSAGE:
                channel, _, log_time, _ = MESSAGE.unpack_from(body)
                self.message(self.offset, end - self.offset, channel, log_time)
            else:
                _note(self, opcode, self.offset, body)
            self.offset = end
        begin = max(self.offset - _COMPARED_BYTES, 0)
        stream.seek(begin)
        self.before = stream.read(self.offset - begin)

    def message(self, offset: int, size: int, channel: int, log_time: int) -> None:
        if not self.seen:
            self.begin, self.start_ns, self.end_ns = offset, log_time, log_time
        self.seen.add(channel)
        self.counts[channel] += 1
        self.start_ns, self.end_ns = min(self.start_ns, log_time), max(self.end_ns, log_time)
        self.end = offset + size
        if self.end - self.begin >= _BLOCK_BYTES:
            self.close_block()

    def close_block(self) -> None:
        self.blocks += self._open_block()
        self.seen = set()

    def layout(self, *, whole: bool) -> Layout:
        """Return the layout of the scanned part."""
        blocks = tuple(sorted((*self.blocks, *self._open_block()), key=lambda block: block[:4]))
        return Layout(
            channels=dict(self.channels),
            counts=dict(self.counts),
            schemas=dict(self.schemas),
            blocks=blocks,
            attachments=dict(self.attachments),
            metadata=tuple(self.metadata),
            start_ns=min((block.start_ns for block in blocks), default=0),
            end_ns=max((block.end_ns for block in blocks), default=0),
            whole=whole,
        )

    def _open_block(self) -> list[Block]:
        if not self.seen:
            return []
        length = self.end - self.begin
        return [Block(self.start_ns, self.end_ns, self.begin, length, frozenset(self.seen), chunk=False)]


class _Scans:
    """Scans of growing files, each of which continues at its last position."""

    def __init__(self) -> None:
        self._scans: OrderedDict[tuple[Path, int], _Scan] = OrderedDict()
        self._lock = threading.Lock()

    def layout(self, path: Path, inode: int, stream: IO[bytes], *, whole: bool) -> Layout:
        """Return the current layout of a file.

        Raises:
            DAMAGE: One of these, if a record cannot be read.
        """
        key = path, inode
        with self._lock:
            scan = self._scans.pop(key, None) or _Scan()  # no other thread uses it until it is put back
        if not scan.covers(stream):
            scan = _Scan()
        scan.scan_appended(stream)
        found = scan.layout(whole=whole)
        with self._lock:
            self._scans[key] = scan
            if len(self._scans) > _MOST_SCANS:
                self._scans.popitem(last=False)
        return found


_scans = _Scans()


def _note(scan: _Scan, opcode: int, offset: int, content: bytes) -> None:
    """Add a record that is not a message."""
    stream = stream_of(content)
    if opcode == Opcode.SCHEMA:
        schema = Schema.read(stream)
        scan.schemas[schema.id] = schema
    elif opcode == Opcode.CHANNEL:
        channel = Channel.read(stream)
        scan.channels[channel.id] = channel
    elif opcode == Opcode.METADATA and len(content) <= _MOST_METADATA_BYTES:
        scan.metadata.append(Metadata.read(stream))
    elif opcode == Opcode.CHUNK:
        # A chunk is one block, so end the block of unchunked messages before it.
        scan.close_block()
        start_ns, end_ns, unpacked, _ = _CHUNK.unpack_from(content)
        length = RECORD.size + len(content)
        scan.unpacked += unpacked
        check_unpacked(scan.unpacked, offset + length)
        scan.blocks.append(Block(start_ns, end_ns, offset, length, None, chunk=True, unpacked=unpacked))
        with contextlib.suppress(*DAMAGE):  # reading this chunk fails later; other chunks stay readable
            for inner, body in walk_chunk(unpack_chunk(content)):
                if inner == Opcode.MESSAGE:
                    scan.counts[MESSAGE.unpack_from(body)[0]] += 1
                elif inner in (Opcode.SCHEMA, Opcode.CHANNEL):
                    _note(scan, inner, offset, body)
    elif opcode == Opcode.ATTACHMENT:
        at = _ATTACHMENT.size
        texts = []
        for _ in range(2):
            (length,) = _LENGTH.unpack_from(content, at)
            texts.append(content[at + 4 : at + 4 + length].decode())
            at += 4 + length
        size = len(content) - at - 8 - 4
        scan.attachments[texts[0]] = Attached(texts[1], offset + RECORD.size + at + 8, size)
