"""Reading of a file's messages by topic and time, without reading the rest."""

import contextlib
import fcntl
import heapq
import os
import struct
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator
from functools import cached_property
from pathlib import Path
from typing import IO, Any, NamedTuple, Self

from google.protobuf.timestamp_pb2 import Timestamp
from mcap.opcode import Opcode
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory

from robomesh import reason_codes as codes
from robomesh.contract.keys import ROOT
from robomesh.contract.topics import SCHEMAS
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.layout import Attached, Block, layout_of
from robomesh.recordings.records import DAMAGE, MESSAGE, RECORD, unpack_chunk

FOREVER_NS = 1 << 64
# Messages that wait for sorting because their chunk overlaps the next one; above this limit the file's order
# counts.
_MOST_WAITING_BYTES = 64 << 20
# What each of them needs besides its payload, about.
_WAITING_BYTES = 400
# Messages of a topic between the two records of one publication.
_MOST_BETWEEN = 2000


class RecordedMessage(NamedTuple):
    """A recorded message; sorts by its receive time.

    Attributes:
        received_ns: On the recorder's clock, ns since the Unix epoch.
        place: Position in the file, which makes the order unique.
        source_ns: On the publisher's clock, ns since the Unix epoch.
    """

    received_ns: int
    place: tuple[int, int]
    topic: str
    source_ns: int
    sequence: int
    data: bytes


class RecordingFile:
    """A recording, open for reading; for one thread at a time.

    Raises:
        RecordingError: If it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.layout = layout_of(path)
        try:
            self._stream: IO[bytes] = path.open("rb")
        except OSError as error:
            raise RecordingError(codes.RECORDING_FILE(file=path.name, detail=error.strerror)) from None
        with contextlib.suppress(OSError):  # being written, or a disk without locks
            # No recorder deletes a recording that is being read.
            fcntl.flock(self._stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
        self._unpacked: tuple[Block, bytes] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    @cached_property
    def _newest_first(self) -> list[Block]:
        return sorted(self.layout.blocks, key=lambda block: block.end_ns, reverse=True)

    @cached_property
    def topics(self) -> dict[str, frozenset[int]]:
        """The channel ids of each topic."""
        found: dict[str, frozenset[int]] = {}
        for number, channel in self.layout.channels.items():
            found[channel.topic] = found.get(channel.topic, frozenset()) | {number}
        return found

    def schema_name(self, topic: str) -> str:
        """Return the full name of a topic's schema: "foxglove.JointStates"; empty: none, or several.

        Raises:
            RecordingError: If the topic is missing.
        """
        schema = self._schema(topic)[1]
        return schema.name if schema is not None else ""

    def decoder(self, topic: str) -> Callable[[bytes], Any] | None:
        """Return the function that decodes a topic's messages; None: they are not protobuf.

        Our schemas are decoded as ours: a file's schema of the same name may have other fields.
        """
        encoding, schema = self._schema(topic)
        if schema is None:
            return None
        known = SCHEMAS.get(schema.name)
        if known is not None and encoding == schema.encoding == "protobuf":
            return known.FromString
        try:
            return DecoderFactory().decoder_for(encoding, schema)
        except (*DAMAGE, TypeError):
            return None

    def clip(self, start_ns: int | None, end_ns: int | None) -> tuple[int, int]:
        """Return the part of a range of receive times (both included) that the file contains [ns].

        Args:
            start_ns, end_ns: ns since the Unix epoch; None: the file's first or last message.

        Raises:
            RecordingError: If the range ends before it begins, or is outside the recording.
        """
        first, last = self.layout.start_ns, self.layout.end_ns
        begin, end = first if start_ns is None else start_ns, last if end_ns is None else end_ns
        if start_ns is not None and end_ns is not None and end < begin:
            raise RecordingError(codes.RECORDING_TIMES())
        if last and (begin > last or end < first):
            begin, end = (begin, max(begin, end)) if begin > last else (min(begin, end), end)
            raise RecordingError(
                codes.RECORDING_OUTSIDE(
                    file=self.path.name,
                    start=_text(begin),
                    end=_text(end),
                    first=_text(first),
                    last=_text(last),
                )
            )
        return max(begin, first), min(end, last)

    def messages(
        self,
        topics: Collection[str] | None = None,
        *,
        start_ns: int = 0,
        end_ns: int = FOREVER_NS,
    ) -> Iterator[RecordedMessage]:
        """Yield messages by their receive time, from `start_ns` up to but excluding `end_ns`.

        Yields a publication once, even if the file is merged from recordings that both contain it.

        Raises:
            RecordingError: If the topic is missing, or the file is damaged there.
        """
        wanted = None if topics is None else frozenset().union(*map(self._channels, topics))
        return self._once(self._sorted(wanted, start_ns, end_ns))

    def _once(self, messages: Iterable[RecordedMessage]) -> Iterator[RecordedMessage]:
        """Yield each publication once: recordings that were merged may overlap."""
        if len(self.layout.recordings) < 2:
            yield from messages
            return
        known: dict[str, tuple[set[tuple[int, ...]], deque[tuple[int, ...]]]] = {}
        for message in messages:
            if message.topic.startswith(f"{ROOT}/"):  # other programs may number all messages 0
                seen, order = known.setdefault(message.topic, (set(), deque()))
                publication = message.source_ns, message.sequence, hash(message.data)
                if publication in seen:
                    continue
                seen.add(publication)
                order.append(publication)
                if len(order) > _MOST_BETWEEN:
                    seen.discard(order.popleft())
            yield message

    def _sorted(self, wanted: frozenset[int] | None, start_ns: int, end_ns: int) -> Iterator[RecordedMessage]:
        waiting: list[RecordedMessage] = []
        waiting_bytes = 0
        for block in self.layout.blocks:
            if block.end_ns < start_ns or block.start_ns >= end_ns or not _has(block, wanted):
                continue
            while waiting and waiting[0].received_ns < block.start_ns:
                waiting_bytes -= len(waiting[0].data) + _WAITING_BYTES
                yield heapq.heappop(waiting)
            for message in self._read(block, wanted, start_ns, end_ns):
                heapq.heappush(waiting, message)
                waiting_bytes += len(message.data) + _WAITING_BYTES
                # One small chunk may unpack to millions of messages.
                while waiting_bytes > _MOST_WAITING_BYTES:
                    waiting_bytes -= len(waiting[0].data) + _WAITING_BYTES
                    yield heapq.heappop(waiting)
        while waiting:
            yield heapq.heappop(waiting)

    def newest(
        self, topic: str, at_ns: int, accept: Callable[[bytes], bool] = lambda data: True
    ) -> RecordedMessage | None:
        """Return the newest message of a topic that was received until `at_ns`; None: there is none.

        Args:
            accept: Returns whether a message with these bytes counts.

        Raises:
            RecordingError: If the topic is missing, or the file is damaged there.
        """
        wanted = self._channels(topic)
        best: RecordedMessage | None = None
        for block in self._newest_first:
            if best is not None and block.end_ns < best.received_ns:
                break
            if block.start_ns > at_ns or not _has(block, wanted):
                continue
            for message in sorted(self._read(block, wanted, 0, at_ns + 1), reverse=True):
                if best is not None and message < best:
                    break
                if accept(message.data):
                    best = message
                    break
        return best

    def last(self, topic: str, at_ns: int, count: int) -> list[RecordedMessage]:
        """Return the newest `count` messages of a topic that were received until `at_ns`, oldest first.

        Raises:
            RecordingError: If the topic is missing, or the file is damaged there.
        """
        wanted = self._channels(topic)
        found: list[RecordedMessage] = []
        for block in self._newest_first:
            if len(found) >= count and block.end_ns < found[0].received_ns:
                break
            if block.start_ns <= at_ns and _has(block, wanted):
                found = [*self._once(sorted([*found, *self._read(block, wanted, 0, at_ns + 1)]))][-count:]
        return found

    def state_at(self, topics: Collection[str], at_ns: int) -> dict[str, RecordedMessage]:
        """Return the newest message of each topic that was received until `at_ns`, if there is one.

        Raises:
            RecordingError: If the topic is missing, or the file is damaged there.
        """
        channels = {topic: self._channels(topic) for topic in topics}
        newest: dict[str, RecordedMessage] = {}
        for block in self._newest_first:
            if block.start_ns > at_ns:
                continue
            wanted: frozenset[int] = frozenset().union(
                *(
                    own
                    for topic, own in channels.items()
                    if topic not in newest or newest[topic].received_ns <= block.end_ns
                )
            )
            if wanted and _has(block, wanted):
                for message in self._read(block, wanted, 0, at_ns + 1):
                    if message.topic not in newest or newest[message.topic] < message:
                        newest[message.topic] = message
        return newest

    def attached(self, name: str) -> Attached:
        """Return the position of an attachment.

        Raises:
            RecordingError: If there is no attachment with that name.
        """
        try:
            return self.layout.attachments[name]
        except KeyError:
            there = ", ".join(self.layout.attachments) or "none"
            reason = codes.RECORDING_NO_ATTACHMENT(file=self.path.name, name=name, attachments=there)
            raise RecordingError(reason) from None

    def attachment(self, name: str) -> bytes:
        """Return the bytes of an attachment.

        Raises:
            RecordingError: If there is no attachment with that name.
        """
        found = self.attached(name)
        return self._bytes(found.offset, found.length)

    def _schema(self, topic: str) -> tuple[str, Schema | None]:
        """Return the encoding and the schema of a topic's messages; None: it has none, or several."""
        channels = [self.layout.channels[number] for number in sorted(self._channels(topic))]
        found = [(each.message_encoding, self.layout.schemas.get(each.schema_id)) for each in channels]
        encoding, schema = found[0]
        if schema is None or any(each != encoding or not _equal(other, schema) for each, other in found):
            return encoding, None
        return encoding, schema

    def _channels(self, topic: str) -> frozenset[int]:
        try:
            return self.topics[topic]
        except KeyError:
            there = ", ".join(sorted(self.topics)) or "none"
            reason = codes.RECORDING_NO_TOPIC(file=self.path.name, topic=topic, topics=there)
            raise RecordingError(reason) from None

    def _bytes(self, offset: int, length: int) -> bytes:
        try:
            if offset + length > os.fstat(self._stream.fileno()).st_size:
                raise RecordingError(codes.RECORDING_ENDS(file=self.path.name, byte=offset + length))
            data = os.pread(self._stream.fileno(), length, offset)
        except OSError as error:
            reason = codes.RECORDING_FILE(file=self.path.name, detail=error.strerror)
            raise RecordingError(reason) from None
        if len(data) < length:
            raise RecordingError(codes.RECORDING_ENDS(file=self.path.name, byte=offset + length))
        return data

    def _read(
        self, block: Block, wanted: frozenset[int] | None, start_ns: int, end_ns: int
    ) -> Iterator[RecordedMessage]:
        data = self._records(block)
        channels = self.layout.channels
        at, end = 0, len(data)
        try:
            while at + RECORD.size <= end:
                opcode, length = RECORD.unpack_from(data, at)
                if not opcode:
                    raise ValueError("an invalid record")
                at += RECORD.size
                if opcode == Opcode.MESSAGE:
                    channel, sequence, received_ns, source_ns = MESSAGE.unpack_from(data, at)
                    if start_ns <= received_ns < end_ns and (wanted is None or channel in wanted):
                        yield RecordedMessage(
                            received_ns,
                            (block.offset, at),
                            channels[channel].topic,
                            source_ns,
                            sequence,
                            data[at + MESSAGE.size : at + length],
                        )
                at += length
        except (struct.error, KeyError, ValueError):
            reason = codes.RECORDING_DAMAGED(file=self.path.name, byte=block.offset + at)
            raise RecordingError(reason) from None

    def _records(self, block: Block) -> bytes:
        """Return a block's unpacked records; caches the last block, where most callers read on."""
        if self._unpacked is not None and self._unpacked[0] == block:
            return self._unpacked[1]
        data = self._bytes(block.offset, block.length)
        if block.chunk:
            try:
                data = unpack_chunk(data[RECORD.size :], block.unpacked)
            except DAMAGE as error:
                raise RecordingError(f"{self.path.name}: damaged near byte {block.offset}: {error}") from None
        self._unpacked = block, data
        return data


def _has(block: Block, wanted: frozenset[int] | None) -> bool:
    return wanted is None or block.channels is None or not wanted.isdisjoint(block.channels)


def _equal(one: Schema | None, other: Schema) -> bool:
    return one is not None and (one.name, one.encoding, one.data) == (other.name, other.encoding, other.data)


def _text(time_ns: int) -> str:
    timestamp = Timestamp()
    timestamp.FromNanoseconds(time_ns)
    return timestamp.ToJsonString()
