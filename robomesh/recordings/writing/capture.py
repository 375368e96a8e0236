"""An open recording: the recorded topics of one robot in one MCAP file, complete up to the last write.

The open file is unchunked, so that a reader gets every complete message even if the writer was killed.
`rewrite` adds chunks and an index to a closed file.
"""

import contextlib
import errno
import fcntl
import os
import threading
from collections import Counter, deque
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from google.protobuf.message import Message
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Schema
from mcap_protobuf.schema import build_file_descriptor_set

from robomesh import reason_codes as codes
from robomesh.contract.header import Header
from robomesh.contract.topics import Topic
from robomesh.recordings import records
from robomesh.recordings.errors import CaptureError
from robomesh.recordings.metadata import about_name, about_record, end_record


def is_being_written(path: Path) -> bool:
    """Return whether a capture in any running process has the file open.

    Raises:
        OSError: If it cannot be opened.
    """
    file = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # a disk without locks
        return False
    finally:
        os.close(file)
    return False


class Capture:
    """An open file.

    Call `add`, `add_text` and `hand_over` from one thread; call `attach` and the functions that wait for the
    disk from any thread. The file is locked (flock) while it is open: `is_being_written`.

    Args:
        about: What the recording says of itself: site, robot, name, started_by, cause, part.

    Raises:
        CaptureError: If it cannot be created.
    """

    def __init__(self, path: Path, about: Mapping[str, str], *, start_ns: int) -> None:
        self.path = path
        self.about = dict(about)
        self.start_ns = start_ns
        # Messages by topic.
        self.counts: Counter[str] = Counter()
        self.attached: list[str] = []
        # Bytes handed over and not yet written.
        self.waiting_bytes = 0
        # Error after which writing was abandoned.
        self.failure: OSError | None = None
        self._contents = records.Contents()
        self._topics: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._batch: list[bytes] = []
        self._lock = threading.Lock()
        self._ready: deque[bytes] = deque()
        self._end = self._written = 0
        self._finished = False
        # Protects writing and closing. The descriptor is None after closing, because the system reuses its
        # number.
        self._writing = threading.Lock()
        self._file: int | None = None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        except OSError as error:
            raise CaptureError(codes.RECORDING_NOT_WRITABLE(file=path, detail=error.strerror)) from None
        with contextlib.suppress(OSError):  # a disk without locks
            fcntl.flock(self._file, fcntl.LOCK_EX)
        self._put(records.start())
        self._name = about_name(self.about.get("site", ""), self.about.get("robot", ""), path.stem)
        self._put_record(records.record_bytes(about_record(self._name, self.about, start_ns)))

    @property
    def size(self) -> int:
        """Size of the file when all waiting bytes are written."""
        return self._end

    @property
    def first_ns(self) -> int:
        """Receive time of the first message, ns since the Unix epoch; without messages that of the start."""
        return self._contents.start_ns or self.start_ns

    def add(self, key: str, topic: Topic, header: Header, payload: bytes, *, received_ns: int) -> None:
        """Add a received publication.

        Args:
            received_ns: Time of arrival, ns since the Unix epoch.
        """
        channel = self._topics.get(key)
        if channel is None:
            channel = self._register(key, "protobuf", *_protobuf(topic.schema))
        batch = self._batch
        batch.append(
            records.message_head(channel, header.sequence, received_ns, header.source_time_ns, len(payload))
        )
        batch.append(payload)
        self._contents.note_message(channel, received_ns)
        self.counts[key] += 1

    def add_text(self, topic: str, text: str, header: Header, *, received_ns: int) -> None:
        """Add a ROS 2 text (std_msgs/msg/String), the only schema that viewers' URDF layers read."""
        channel = self._topics.get(topic)
        if channel is None:
            channel = self._register(topic, "cdr", "std_msgs/msg/String", "ros2msg", b"string data\n")
        data = text.encode() + b"\0"
        payload = b"\0\1\0\0" + len(data).to_bytes(4, "little") + data
        self._batch += (
            records.message_head(channel, header.sequence, received_ns, header.source_time_ns, len(payload)),
            payload,
        )
        self._contents.note_message(channel, received_ns)

    def attach(self, name: str, media_type: str, data: bytes, *, time_ns: int) -> None:
        """Attach a file that explains the recording; ignores a second one with the same name."""
        attachment = Attachment(
            create_time=time_ns, log_time=time_ns, name=name, media_type=media_type, data=data
        )
        with self._lock:
            if name not in self.attached and not self._finished:
                self.attached.append(name)
                self._put_record(records.record_bytes(attachment))

    def hand_over(self) -> None:
        """Release the added messages for writing."""
        if self._batch:
            batch, self._batch = self._batch, []
            with self._lock:
                self._put(b"".join(batch))

    def write_out(self) -> None:
        """Write the released messages to the file.

        Raises:
            OSError: If the disk refuses, or the file is closed. `give_up` keeps the messages written so far.
        """
        with self._writing:
            self._write_out()

    def sync(self) -> None:
        """Flush the written data to the disk.

        Raises:
            OSError: If the disk refuses, or the file is closed.
        """
        os.fsync(self._open_file())

    def finish(self, missed: Mapping[str, int]) -> None:
        """Write the end of the file and close it.

        Args:
            missed: Number of publications that are not in the file, by topic.

        Raises:
            OSError: If the disk refuses, or the file is already closed.
        """
        self._open_file()
        self.hand_over()
        with self._lock:
            end = end_record(self._name, self._contents.end_ns, missed)
            self._put_record(records.record_bytes(end))
            self._put(self._contents.end(self._end))
            self._finished = True
        with self._writing:
            self._write_out()
            self.sync()
            self._close()

    def give_up(self, error: OSError | None = None) -> None:
        """Close an open file after the last complete write, because the disk accepts no more."""
        self.failure = self.failure or error
        with self._writing:
            if self._file is not None:
                with contextlib.suppress(OSError):
                    os.ftruncate(self._file, self._written)
                with contextlib.suppress(OSError):
                    self._close()

    def _write_out(self) -> None:
        file = self._open_file()
        while self._ready:
            data = memoryview(self._ready[0])
            while data:
                data = data[os.write(file, data) :]
            size = len(self._ready.popleft())
            self._written += size
            with self._lock:
                self.waiting_bytes -= size

    def _open_file(self) -> int:
        if self._file is None:
            raise OSError(errno.EBADF, f"{self.path.name} is closed")
        return self._file

    def _close(self) -> None:
        file, self._file = self._open_file(), None
        os.close(file)

    def _register(self, topic: str, encoding: str, name: str, schema_encoding: str, data: bytes) -> int:
        schema_id = self._schemas.get(name)
        if schema_id is None:
            schema_id = self._schemas[name] = len(self._schemas) + 1
            schema = Schema(id=schema_id, data=data, encoding=schema_encoding, name=name)
            self._contents.schemas[schema_id] = schema
            self._batch.append(records.record_bytes(schema))
        channel_id = self._topics[topic] = len(self._topics) + 1
        channel = Channel(
            id=channel_id, topic=topic, message_encoding=encoding, schema_id=schema_id, metadata={}
        )
        self._contents.channels[channel_id] = channel
        self._batch.append(records.record_bytes(channel))
        return channel_id

    def _put_record(self, data: bytes) -> None:
        """Write metadata or an attachment; the summary of the file contains its position."""
        opcode = Opcode(data[0])
        self._contents.note(opcode, data[records.RECORD.size :], self._end)
        self._put(data)

    def _put(self, data: bytes) -> None:
        self._end += len(data)
        self.waiting_bytes += len(data)
        self._ready.append(data)


_DESCRIPTORS: dict[str, bytes] = {}


def _protobuf(schema: type[Message]) -> tuple[str, str, bytes]:
    """Return name, encoding and data of a message's schema."""
    name: str = schema.DESCRIPTOR.full_name
    if name not in _DESCRIPTORS:
        described: Any = build_file_descriptor_set(schema)
        _DESCRIPTORS[name] = described.SerializeToString()
    return name, "protobuf", _DESCRIPTORS[name]
