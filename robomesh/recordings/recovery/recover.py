"""State of a recording's file, and its recovery after a killed writer or a full disk."""

import contextlib
import itertools
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum, auto
from pathlib import Path
from types import MappingProxyType

from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Metadata

from robomesh.recordings import records
from robomesh.recordings.errors import CaptureError
from robomesh.recordings.metadata import about_name, end_record, is_about
from robomesh.recordings.recovery.rewrite import rewrite
from robomesh.recordings.writing.capture import is_being_written


class State(Enum):
    """State of a file."""

    OPEN = auto()  # being written
    UNFINISHED = auto()  # its writer was killed
    CLOSED = auto()  # complete, but without an index of its messages
    INDEXED = auto()


@dataclass(frozen=True)
class Recovered:
    """Result of a recovery.

    Attributes:
        cut: The file ended in the middle of a record, or without a summary.
        damaged: Number of omitted chunks, which could not be unpacked.
    """

    messages: int
    cut: bool
    damaged: int = 0


def state_of(path: Path) -> State:
    """Return the state of a file.

    Raises:
        CaptureError: If it is not an MCAP file, or cannot be read.
    """
    try:
        if is_being_written(path):
            return State.OPEN
        with path.open("rb") as stream:
            begin = stream.read(len(records.MAGIC))
            if begin != records.MAGIC[: len(begin)]:
                raise CaptureError(f"{path.name}: not an MCAP file: its first bytes are wrong")
            stream.seek(0)
            try:
                summary = make_reader(stream).get_summary()
            except records.DAMAGE:
                return State.UNFINISHED
    except OSError as error:
        raise CaptureError(f"{path}: cannot be read: {error.strerror}") from None
    if summary is None or summary.statistics is None:
        return State.UNFINISHED
    return State.INDEXED if summary.chunk_indexes or not summary.statistics.message_count else State.CLOSED


def is_ours(path: Path) -> bool:
    """Return whether our recorder wrote the file; files of other programs are rewritten only on request.

    Raises:
        OSError: If it cannot be read.
    """
    with path.open("rb") as stream, contextlib.suppress(*records.DAMAGE):
        for opcode, body, _ in itertools.islice(records.walk(stream), 2):
            if opcode == Opcode.METADATA and is_about(Metadata.read(records.stream_of(body)).name):
                return True
    return False


def recover(path: Path, progress: Callable[[float], None] = lambda _: None) -> Recovered:
    """Rewrite a file completely, with an index; keep the original until the new file is verified.

    Raises:
        CaptureError: If there is nothing to recover, or the new file would differ.
        OSError: If the disk refuses.
    """
    if path.stat().st_size < len(records.MAGIC):
        raise CaptureError(f"{path.name}: nothing to recover: its recorder was killed before the first write")
    unfinished = state_of(path) is State.UNFINISHED
    about = {"recovered": "yes"} if unfinished else None
    copied = rewrite([path], path, about=about, progress=progress)
    return Recovered(copied.messages.total(), copied.cut > 0, copied.damaged)


def close_in_place(path: Path, missed: Mapping[str, int] = MappingProxyType({})) -> None:
    """Append the end of an unfinished file in place, for a full disk without space for a rewritten file.

    Args:
        missed: Number of publications that are not in the file, by topic.

    Raises:
        OSError: If the disk has no space for the end either.
    """
    contents, end = records.Contents(), 0
    with path.open("rb") as stream:
        for opcode, body, after in records.walk(stream):
            if opcode == Opcode.DATA_END:
                return
            contents.note(opcode, body, after - len(body) - records.RECORD.size)
            end = after
    with path.open("r+b") as stream:
        stream.truncate(end)
        stream.seek(end)
        names = [each.name for each in contents.metadata if is_about(each.name)]
        name = names[0] if names else about_name("", "", path.stem)
        data = records.record_bytes(end_record(name, contents.end_ns, missed))
        contents.note(data[0], data[records.RECORD.size :], end)
        stream.write(data + contents.end(end + len(data)))
        stream.flush()
        os.fsync(stream.fileno())
