"""Rewriting of one or several consecutive closed recordings: 1 MiB zstd chunks, an index, verified, renamed.

`python -m robomesh.recordings.recovery.rewrite` is a worker process, so that the recorder never waits for it.
It reports its progress, a number from 0 to 1.
"""

import contextlib
import os
import zlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import IO

from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Metadata, Schema, Statistics

from robomesh.files.worker import answer_all, report
from robomesh.recordings import records
from robomesh.recordings.errors import CaptureError
from robomesh.recordings.metadata import is_about, is_end
from robomesh.recordings.names import INDEXING
from robomesh.recordings.writing.capture import is_being_written
from robomesh.recordings.writing.indexed_writer import Copied, IndexedWriter

_STEP_BYTES = 8 << 20
# Longest unreadable end of a file after a kill or a power cut; a longer one is damage.
_MOST_TAIL_BYTES = 4 << 20
Progress = Callable[[float], None]
# Sources, target and metadata.
_Question = tuple[Sequence[Path], Path, Mapping[str, str]]


def rewrite(
    sources: Sequence[Path],
    target: Path,
    *,
    about: Mapping[str, str] | None = None,
    progress: Progress = lambda _: None,
) -> Copied:
    """Copy the sources into one new file, verify it, and then rename it to the target.

    The target may be one of the sources; it stays unchanged until the rename. Several sources become one
    recording.

    Args:
        about: Additions and changes to what the recording says of itself.

    Raises:
        CaptureError: If the new file differs from the sources, no source is a recording, or one is still
            being written, or is damaged other than at its end or within a chunk.
        OSError: If the disk refuses.
    """
    for source in sources:
        if is_being_written(source):
            raise CaptureError(f"{source.name} is being recorded: end the recording first")
    new = target.with_suffix(INDEXING)
    total = sum(source.stat().st_size for source in sources) or 1
    done = 0

    def report(size: int) -> None:
        nonlocal done
        done += size
        progress(min(done / total, 1.0) * 0.8)  # the rest is for the verification

    try:
        with new.open("wb") as stream:
            writer = IndexedWriter(stream, about or {}, file=target.stem, joined=len(sources) > 1)
            for source in sources:
                _copy(source, writer, report)
            if not writer.copied.messages and not writer.recordings:
                raise CaptureError(f"{sources[0].name}: not a readable recording")
            writer.finish()
            stream.flush()
            os.fsync(stream.fileno())
        _check(new, writer)
        progress(1.0)
        new.replace(target)
        folder = os.open(target.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    finally:
        with contextlib.suppress(FileNotFoundError):
            new.unlink()
    return writer.copied


class _Source:
    """A file being copied: maps its ids of schemas and channels to those of the new file."""

    def __init__(self, writer: IndexedWriter, size: int) -> None:
        self._writer = writer
        self._size, self._unpacked = size, 0
        self._schemas: dict[int, tuple[int, Schema]] = {}
        self._channels: dict[int, int] = {}
        self._gaps = _Gaps()
        # Numbers of metadata records at the beginnings and ends of recordings.
        self._begun = self._ended = 0
        # Messages by this file's channels, including omitted ones.
        self.counts: Counter[int] = Counter()

    def take(self, opcode: int, body: bytes) -> None:
        """Copy a record."""
        match opcode:
            case Opcode.MESSAGE:
                self._message(body)
            case Opcode.SCHEMA:
                schema = Schema.read(records.stream_of(body))
                self._schemas[schema.id] = (self._writer.schema(schema), schema)
            case Opcode.CHANNEL:
                channel = Channel.read(records.stream_of(body))
                schema_id, of = self._schemas.get(channel.schema_id, (0, None))
                self._channels[channel.id] = self._writer.channel(channel, schema_id, of)
            case Opcode.ATTACHMENT:
                self._writer.attachment(Attachment.read(records.stream_of(body)))
            case Opcode.METADATA:
                metadata = Metadata.read(records.stream_of(body))
                self._begun += is_about(metadata.name)
                self._ended += is_end(metadata.name)
                self._writer.metadata(metadata)
            case Opcode.CHUNK:
                try:
                    unpacked = records.unpack_chunk(body)
                except records.DAMAGE:
                    self._writer.copied.damaged += 1
                    return
                self._unpacked += len(unpacked)
                records.check_unpacked(self._unpacked, self._size)
                for each in records.walk_chunk(unpacked):
                    self.take(*each)

    def end(self) -> None:
        """Count the missing publications by their numbers if the writer was killed before it wrote them.

        Between the recordings of a merged file nothing was lost.
        """
        if self._begun == 1 and not self._ended:
            self._writer.lost.update(self._gaps.by_topic(self._writer.topic))

    def _message(self, body: bytes) -> None:
        channel, sequence, log_time, publish_time = records.MESSAGE.unpack_from(body)
        if channel not in self._channels:
            raise ValueError(f"its channel {channel} has no record")
        number = self._channels[channel]
        self.counts[channel] += 1
        mark = (sequence, publish_time)
        if number not in self._gaps.last and self._writer.newest.get(number) == mark:
            return  # each source repeats the description at its beginning
        self._gaps.take(number, *mark)
        self._writer.newest[number] = mark
        if number != channel:
            body = number.to_bytes(2, "little") + body[2:]
        self._writer.message(number, log_time, body)


class _Gaps:
    """Gaps in the publications' numbers, by channel."""

    def __init__(self) -> None:
        self.last: dict[int, tuple[int, int]] = {}
        self._missing: Counter[int] = Counter()

    def take(self, channel: int, sequence: int, publish_time: int) -> None:
        before, when = self.last.get(channel, (sequence - 1, 0))
        if sequence <= before and publish_time <= when:
            self._missing[channel] -= 1  # it arrived late
            return
        if sequence > before:
            self._missing[channel] += sequence - before - 1
        self.last[channel] = (sequence, publish_time)

    def by_topic(self, topic: Callable[[int], str]) -> dict[str, int]:
        return {topic(channel): number for channel, number in self._missing.items() if number > 0}


def _copy(path: Path, writer: IndexedWriter, report: Callable[[int], None]) -> None:
    """Copy a source.

    Raises:
        CaptureError: If it is damaged other than at its end or within a chunk.
    """
    size = path.stat().st_size
    source, reported, end, whole = _Source(writer, size), 0, 0, False
    with path.open("rb") as stream:
        statistics = _statistics(stream)
        try:
            for opcode, body, after in records.walk(stream) if size >= len(records.MAGIC) else ():
                whole = opcode == Opcode.DATA_END
                source.take(opcode, body)
                end = after
                if end - reported >= _STEP_BYTES:
                    report(end - reported)
                    reported = end
        except records.DAMAGE as error:
            words = f"damaged near byte {end}" if end else "not a readable recording"
            raise CaptureError(f"{path.name}: {words}: {error}") from None
        if not whole and not _is_tail(stream, end, size):
            raise CaptureError(f"{path.name}: damaged near byte {end}, {size - end} bytes before its end")
    if statistics is not None and (
        not whole or dict(source.counts) != dict(statistics.channel_message_counts)
    ):
        raise CaptureError(
            f"{path.name}: only {source.counts.total()} of {statistics.message_count} messages can be read"
        )
    source.end()
    writer.copied.cut += not whole
    report(size - reported)


def _statistics(stream: IO[bytes]) -> Statistics | None:
    """Return the statistics of a closed file; None: the file was not closed."""
    try:
        summary = make_reader(stream).get_summary()
    except records.DAMAGE:
        return None
    return None if summary is None else summary.statistics


def _is_tail(stream: IO[bytes], begin: int, size: int) -> bool:
    """Return whether the unreadable rest of a file is what a killed writer leaves."""
    if size - begin <= _MOST_TAIL_BYTES:
        return True
    stream.seek(begin)
    head = stream.read(records.RECORD.size)
    opcode, length = records.RECORD.unpack(head)
    if opcode in (Opcode.CHUNK, Opcode.ATTACHMENT):
        return begin + len(head) + int(length) > size and length <= records.MOST_RECORD_BYTES
    while head:
        if head.count(0) != len(head):
            return False
        head = stream.read(_STEP_BYTES)
    return True  # zeros: allocated before a power cut, but not written


def _check(path: Path, writer: IndexedWriter) -> None:
    """Read every byte of the new file and compare it with the copied data.

    Raises:
        CaptureError: If it differs.
    """
    found = Copied()
    with path.open("rb") as stream:
        try:
            for opcode, body, _ in records.walk(stream):
                if opcode == Opcode.CHUNK:
                    for inner, each in records.walk_chunk(records.unpack_chunk(body)):
                        if inner == Opcode.MESSAGE:
                            found.messages[int.from_bytes(each[:2], "little")] += 1
                            found.crc = zlib.crc32(each, found.crc)
                elif opcode == Opcode.ATTACHMENT:
                    attachment = Attachment.read(records.stream_of(body))
                    found.attachments.add((attachment.name, zlib.crc32(attachment.data)))
            stream.seek(0)
            summary = make_reader(stream).get_summary()
        except records.DAMAGE as error:
            raise CaptureError(f"{path}: cannot be read back: {error}") from None
    expected = writer.copied
    counts = None if summary is None or summary.statistics is None else summary.statistics
    if (
        (found.messages, found.crc, found.attachments)
        != (expected.messages, expected.crc, expected.attachments)
        or counts is None
        or counts.channel_message_counts != dict(expected.messages)
    ):
        raise CaptureError(f"{path}: differs from its sources, which were kept")


def _begin(_: None) -> Callable[[_Question], None]:
    def answer(question: _Question) -> None:
        sources, target, about = question
        rewrite(sources, target, about=about, progress=report)

    return answer


if __name__ == "__main__":
    answer_all(_begin)
