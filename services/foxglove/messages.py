"""Conversion of samples for Foxglove: messages with their own times, events as logs, schemas."""

from collections.abc import Iterator
from typing import Any

from foxglove import Schema
from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message

from robomesh.contract.topics import History, Topic
from robomesh.publications.subscription import Sample
from robomesh.schemas import robomesh_pb2 as schema

# A message's bytes, and the time of its content [ns since the Unix epoch].
Timed = tuple[bytes, int]


def protobuf_schema(message: type[Message]) -> Schema:
    """Return a message's schema with its dependencies."""
    described = FileDescriptorSet()
    seen: set[str] = set()

    def add(file: Any) -> None:
        if file.name not in seen:
            seen.add(file.name)
            for needed in file.dependencies:
                add(needed)
            file.CopyToProto(described.file.add())

    add(message.DESCRIPTOR.file)
    return Schema(name=message.DESCRIPTOR.full_name, encoding="protobuf", data=described.SerializeToString())


def text_message(text: str) -> bytes:
    """Encode a text as ROS 2's std_msgs/msg/String (CDR)."""
    data = text.encode() + b"\0"
    return b"\0\1\0\0" + len(data).to_bytes(4, "little") + data


TEXT_SCHEMA = Schema(name="std_msgs/msg/String", encoding="ros2msg", data=b"string data\n")


def timed(row: Topic, sample: Sample) -> Iterator[Timed]:
    """Yield a sample's messages with their times; none of a last value of unknown age that can expire.

    Raises:
        MessageError: If it cannot be decoded.
    """
    if sample.live:
        yield sample.payload, sample.header.source_time_ns
        return
    match row.history:
        case History.LAST_100:
            answer: Any = sample.message()
            ((_, entries),) = answer.ListFields() or ((None, ()),)
            for entry in entries:
                yield entry.SerializeToString(), entry.timestamp.ToNanoseconds()
        case History.KEY_FRAME:
            frames: Any = sample.message()
            for frame in frames.frames:
                yield frame.data, frame.source_time_ns
        case _:
            # A last value may be hours old; with a heartbeat it is at most one heartbeat old.
            if row.stale_after_s is None or row.heartbeat_s is not None:
                yield sample.payload, sample.header.source_time_ns


_LEVELS = {
    schema.Event.DEBUG: Log.DEBUG,
    schema.Event.INFO: Log.INFO,
    schema.Event.WARNING: Log.WARNING,
    schema.Event.ERROR: Log.ERROR,
    schema.Event.CRITICAL: Log.FATAL,
}


def log_of(event: bytes, robot: str) -> bytes:
    """Convert an event to the message of Foxglove's log panel.

    Raises:
        DecodeError: If it is not an event.
    """
    decoded = schema.Event.FromString(event)
    level = _LEVELS.get(decoded.severity, Log.UNKNOWN)
    # The log has no number for the severity of a newer program.
    more = f" severity {decoded.severity}" if level == Log.UNKNOWN and decoded.severity else ""
    log = Log(
        timestamp=decoded.timestamp,
        level=level,
        message=f"{decoded.text} [{decoded.code}]{more}",
        name=f"{robot} {decoded.source}".strip(),
    )
    return log.SerializeToString()
