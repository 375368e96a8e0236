"""Where in a file its messages lie, learnt without reading them.

A finished file tells it in its summary. One that is still written, or whose writer was killed, is looked
through once: its unchunked records count as blocks of about 1 MiB.
"""

import contextlib
import struct
import threading
from collections import Counter, OrderedDict
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import IO, NamedTuple

from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, ChunkIndex, Metadata, Schema
from mcap.summary import Summary

from mcap_files.errors import RecordingError
from mcap_files.records import (
    DAMAGE,
    MAGIC,
    MESSAGE,
    MOST_RECORD_BYTES,
    RECORD,
    stream_of,
    unpack_chunk,
    walk_chunk,
)

_BLOCK_BYTES = 1 << 20
_ATTACHMENT = struct.Struct("<QQ")
_LENGTH = struct.Struct("<I")
# What a chunk begins with: its times, then its unpacked size and checksum.
_CHUNK = struct.Struct("<QQQI")
# Files that may still grow, whose look through goes on from where it was.
_MOST_SCANS = 64
# Before that place, compared: a file that was written anew is looked through anew.
_COMPARED_BYTES = 4096


class Block(NamedTuple):
    """Messages that lie together: a chunk, or a stretch of unchunked records.

    Attributes:
        channels: That it has messages of; None: nobody knows.
        chunk: It is a chunk's record, to be unpacked.
    """

    start_ns: int
    end_ns: int
    offset: int
    length: int
    channels: frozenset[int] | None
    chunk: bool


class Attached(NamedTuple):
    """Something attached to a file, and where its bytes lie in it."""

    media_type: str
    offset: int
    length: int


@dataclass(frozen=True)
class Layout:
    """Where a file's messages lie, in order of time.

    Attributes:
        counts: Messages of each channel.
        whole: It was closed: it has a summary.
    """

    channels: dict[int, Channel]
    counts: dict[int, int]
    schemas: dict[int, Schema]
    blocks: tuple[Block, ...]
    attachments: dict[str, Attached]
    metadata: dict[str, dict[str, str]]
    start_ns: int
    end_ns: int
    whole: bool


def layout_of(path: Path) -> Layout:
    """A file's layout, learnt once for each state that it was in.

    Raises:
        RecordingError: If it cannot be read.
    """
    try:
        found = path.stat()
        return _layout_of(path, found.st_ino, found.st_size, found.st_mtime_ns)
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be read: {error.strerror}") from None


@lru_cache(maxsize=256)
def _layout_of(path: Path, inode: int, size: int, mtime_ns: int) -> Layout:
    with path.open("rb") as stream:
        if stream.read(len(MAGIC)) != MAGIC:
            raise RecordingError(f"{path.name}: no MCAP file: it does not begin as one")
        try:
            stream.seek(0)
            reader = make_reader(stream)
            summary = reader.get_summary()
            if summary is not None and summary.statistics is not None and summary.chunk_indexes:
                metadata = {record.name: dict(record.metadata) for record in reader.iter_metadata()}
                return _indexed(summary, metadata, size)
        except DAMAGE:
            pass  # its end is missing or damaged; what comes before may be whole
        try:
            return _scans.layout(path, inode, stream, whole=_ends_whole(path, size))
        except DAMAGE as error:
            raise RecordingError(f"{path.name}: no recording that can be read: {error}") from None


def _indexed(summary: Summary, metadata: dict[str, dict[str, str]], size: int) -> Layout:
    """What a summary tells, which anybody may have written.

    Raises:
        ValueError: If it cannot be so.
    """
    assert summary.statistics is not None
    blocks = [_block_of(chunk, size) for chunk in summary.chunk_indexes]
    attachments = {}
    for each in summary.attachment_indexes:
        begin = each.offset + each.length - 4 - each.data_size
        if not 0 <= begin <= size - each.data_size:
            raise ValueError(f"attachment {each.name!r} is told to lie outside the file")
        attachments[each.name] = Attached(each.media_type, begin, each.data_size)
    return Layout(
        channels=summary.channels,
        counts=dict(summary.statistics.channel_message_counts),
        schemas=summary.schemas,
        blocks=tuple(sorted(blocks)),
        attachments=attachments,
        metadata=metadata,
        start_ns=summary.statistics.message_start_time,
        end_ns=summary.statistics.message_end_time,
        whole=True,
    )


def _block_of(chunk: ChunkIndex, size: int) -> Block:
    if chunk.uncompressed_size > MOST_RECORD_BYTES or chunk.chunk_length > MOST_RECORD_BYTES:
        raise RecordingError(
            f"a chunk of {max(chunk.uncompressed_size, chunk.chunk_length) >> 20} MiB: "
            f"{MOST_RECORD_BYTES >> 20} MiB at most"
        )
    if chunk.chunk_start_offset + chunk.chunk_length > size:
        raise ValueError("a chunk is told to lie outside the file")
    return Block(
        chunk.message_start_time,
        chunk.message_end_time,
        chunk.chunk_start_offset,
        chunk.chunk_length,
        frozenset(chunk.message_index_offsets) or None,
        chunk=True,
    )


def _ends_whole(path: Path, size: int) -> bool:
    with path.open("rb") as stream:
        stream.seek(max(size - len(MAGIC), 0))
        return size > 2 * len(MAGIC) and stream.read(len(MAGIC)) == MAGIC


class _Scan:
    """What a look through a file has found so far."""

    def __init__(self) -> None:
        self.channels: dict[int, Channel] = {}
        self.counts: Counter[int] = Counter()
        self.schemas: dict[int, Schema] = {}
        self.blocks: list[Block] = []
        self.attachments: dict[str, Attached] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        # The stretch of unchunked messages that grows.
        self.begin = self.end = 0
        self.start_ns, self.end_ns = 0, 0
        self.seen: set[int] = set()
        # Up to which it has been looked through, and what lies before that.
        self.offset = len(MAGIC)
        self.before = b""

    def knows(self, stream: IO[bytes]) -> bool:
        """Whether the file is the one that was looked through, perhaps grown."""
        stream.seek(self.offset - len(self.before))
        return stream.read(len(self.before)) == self.before

    def go_on(self, stream: IO[bytes]) -> None:
        """Look through what has come since.

        Raises:
            DAMAGE: One of these, at what cannot be read.
        """
        stream.seek(self.offset)
        _scan(stream, self)
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
        """What has been found so far."""
        blocks = tuple(sorted((*self.blocks, *self._open_block()), key=lambda block: block[:4]))
        return Layout(
            channels=dict(self.channels),
            counts=dict(self.counts),
            schemas=dict(self.schemas),
            blocks=blocks,
            attachments=dict(self.attachments),
            metadata=dict(self.metadata),
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
    """Looks through files that may still grow: each goes on from where it was."""

    def __init__(self) -> None:
        self._scans: OrderedDict[tuple[Path, int], _Scan] = OrderedDict()
        self._lock = threading.Lock()

    def layout(self, path: Path, inode: int, stream: IO[bytes], *, whole: bool) -> Layout:
        """The layout of a file as it is now.

        Raises:
            DAMAGE: One of these, at what cannot be read.
        """
        key = path, inode
        with self._lock:
            scan = self._scans.pop(key, None) or _Scan()  # this thread's alone until it is put back
        if not scan.knows(stream):
            scan = _Scan()
        scan.go_on(stream)
        found = scan.layout(whole=whole)
        with self._lock:
            self._scans[key] = scan
            if len(self._scans) > _MOST_SCANS:
                self._scans.popitem(last=False)
        return found


_scans = _Scans()


def _scan(stream: IO[bytes], scan: _Scan) -> None:
    offset = scan.offset
    buffer, at = b"", 0
    while True:
        if len(buffer) - at < RECORD.size + MESSAGE.size:
            buffer, at = buffer[at:] + stream.read(_BLOCK_BYTES), 0
            if len(buffer) < RECORD.size:
                break
        opcode, length = RECORD.unpack_from(buffer, at)
        size = RECORD.size + length
        if opcode in (0, Opcode.DATA_END, Opcode.FOOTER):
            break
        if opcode != Opcode.MESSAGE or len(buffer) - at < size:
            missing = size - (len(buffer) - at)
            if missing > 0:
                if missing > MOST_RECORD_BYTES:
                    break  # no length that a record has: the bytes are damaged from here on
                buffer, at = buffer[at:] + stream.read(max(missing, _BLOCK_BYTES)), 0
                if len(buffer) < size:
                    break  # what was being written when the writer was killed
        if opcode == Opcode.MESSAGE:
            channel, _, log_time, _ = MESSAGE.unpack_from(buffer, at + RECORD.size)
            scan.message(offset, size, channel, log_time)
        else:
            _note(scan, opcode, offset, buffer[at + RECORD.size : at + size])
        at += size
        offset += size
        scan.offset = offset


def _note(scan: _Scan, opcode: int, offset: int, content: bytes) -> None:
    """Take in a record that is no message."""
    stream = stream_of(content)
    if opcode == Opcode.SCHEMA:
        schema = Schema.read(stream)
        scan.schemas[schema.id] = schema
    elif opcode == Opcode.CHANNEL:
        channel = Channel.read(stream)
        scan.channels[channel.id] = channel
    elif opcode == Opcode.METADATA:
        metadata = Metadata.read(stream)
        scan.metadata[metadata.name] = dict(metadata.metadata)
    elif opcode == Opcode.CHUNK:
        # A block of its own: what unchunked messages come before it may not be told from it.
        scan.close_block()
        start_ns, end_ns, *_ = _CHUNK.unpack_from(content)
        scan.blocks.append(Block(start_ns, end_ns, offset, RECORD.size + len(content), None, chunk=True))
        with contextlib.suppress(*DAMAGE):  # who reads it is told; the others still read
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
