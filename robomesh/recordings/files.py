"""Description of a recording from its file."""

import contextlib
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path

from google.protobuf.duration_pb2 import Duration
from google.protobuf.message import DecodeError
from google.protobuf.timestamp_pb2 import Timestamp

from robomesh import reason_codes as codes
from robomesh.contract.keys import parse_key
from robomesh.contract.messages import reason_message
from robomesh.reasons import Reason
from robomesh.recordings.changes import DamagedChangesError, read_changes, set_labels
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.layout import layout_of
from robomesh.recordings.metadata import OneRecording, lost_in
from robomesh.recordings.names import is_recorders, robot_channels
from robomesh.recordings.reading import RecordingFile
from robomesh.recordings.records import number_in
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.schemas.robomesh_pb2 import RecordingChange

# Recordings of a merged file that are listed: another program may have written more.
_MOST_LISTED = 1000


def describe_file(path: Path) -> schema.Recording:
    """Describe a recording; if its writer was killed, the part that can be read.

    Raises:
        RecordingError: If no part can be read.
    """
    try:
        found = path.stat()
    except (OSError, ValueError) as error:  # a path with a null byte is a ValueError
        detail = getattr(error, "strerror", None) or error
        raise RecordingError(codes.RECORDING_FILE(file=path, detail=detail)) from None
    recording = schema.Recording()
    recording.CopyFrom(_described(path, found.st_ino, found.st_size, found.st_mtime_ns))
    with contextlib.suppress(DamagedChangesError):  # the recording itself can be read
        set_labels(recording, read_changes(path), history=True)
    return recording


def describe_deleted(path: Path, changes: Sequence[RecordingChange], *, robot: str) -> schema.Recording:
    """Describe a recording of which only its changes are left."""
    recording = schema.Recording(robot=robot, file=path.name, start=_timestamp(_begun_ns(path)))
    recording.deleted, recording.bytes = True, changes[-1].bytes
    set_labels(recording, changes, history=True)
    return recording


def describe_unreadable(path: Path, *, robot: str, problem: Reason) -> schema.Recording:
    """Describe a file that cannot be read, by its name."""
    name = path.stem.partition("Z_")[2] or path.stem
    recording = schema.Recording(robot=robot, name=name, file=path.name, start=_timestamp(_begun_ns(path)))
    with contextlib.suppress(DamagedChangesError):
        set_labels(recording, read_changes(path))
    set_problem(recording, problem)
    return recording


def set_problem(recording: schema.Recording, problem: Reason) -> None:
    """Set a recording's problem, as text and as reason."""
    recording.problem = problem.text
    recording.problem_reason.CopyFrom(reason_message(problem))


# Listing many described recordings costs only a `stat` each.
@lru_cache(maxsize=4096)
def _described(path: Path, inode: int, size: int, mtime_ns: int) -> schema.Recording:
    if not size:
        raise RecordingError(codes.RECORDING_EMPTY(file=path.name))
    layout = layout_of(path)
    if not layout.whole and not layout.recordings and not layout.counts:
        raise RecordingError(codes.RECORDING_CUT(file=path))
    recording = _told(layout.about)
    recording.file, recording.bytes = path.name, size
    recording.name = recording.name or path.stem
    recording.start.CopyFrom(_timestamp(layout.start_ns or _begun_ns(path)))
    recording.duration.CopyFrom(_duration(layout.end_ns - layout.start_ns))
    recording.attachments.extend(sorted(layout.attachments))
    counts = {channel: number for channel, number in layout.messages.items() if number}
    if len(layout.recordings) > 1 or not all(map(is_recorders, counts)):
        recording.merged_from.extend(map(_merged, layout.recordings[:_MOST_LISTED]))
    if not layout.whole:
        set_problem(recording, codes.RECORDING_KILLED())
    with contextlib.suppress(RecordingError, DecodeError):
        _describe_robot(recording, path)
    lost = lost_in(layout.metadata)
    for topic in sorted({*counts, *lost}):
        recording.topics.add(topic=topic, messages=counts.get(topic, 0), lost=lost[topic])
    return recording


def _told(about: Mapping[str, str]) -> schema.Recording:
    """Return what a recording says of itself, which another program may have written."""
    return schema.Recording(
        site=about.get("site", ""),
        robot=about.get("robot", ""),
        name=about.get("name", ""),
        started_by=about.get("started_by", ""),
        cause=about.get("cause", ""),
        part=number_in(about.get("part", "")),
        recovered=about.get("recovered", "") not in ("", "false"),
    )


def _merged(one: OneRecording) -> schema.Recording:
    """Return the description of a recording in a merged file."""
    recording = _told(one.about)
    if one.start_ns:
        recording.start.CopyFrom(_timestamp(one.start_ns))
    if one.start_ns and one.end_ns:
        recording.duration.CopyFrom(_duration(one.end_ns - one.start_ns))
    for topic, number in sorted(one.lost.items()):
        recording.topics.add(topic=topic, lost=number)
    return recording


def _describe_robot(recording: schema.Recording, path: Path) -> None:
    """Add the robot's name if the file does not tell it, and the newest head of its audit log.

    Raises:
        RecordingError: If several robots have messages, or the file is damaged.
        DecodeError: If the controller's newest state is invalid.
    """
    with RecordingFile(path) as file:
        channels = robot_channels(file.layout.messages, path.name)
        if channels and not recording.robot:
            recording.site, recording.robot, _ = parse_key(next(iter(channels.values())))
        if "controller" not in channels:
            return
        newest = file.newest(channels["controller"], file.layout.end_ns)
        state = schema.ControllerState.FromString(newest.data if newest else b"")
        if state.HasField("audit_head"):
            recording.audit_head.CopyFrom(state.audit_head)


def _begun_ns(path: Path) -> int:
    """Return the start of a file without messages, from its name or its modification time."""
    with contextlib.suppress(ValueError):
        begun = datetime.strptime(path.name.partition("_")[0], "%Y-%m-%dT%H-%M-%S.%fZ").replace(tzinfo=UTC)
        return round(begun.timestamp() * 1e6) * 1000
    with contextlib.suppress(OSError):
        return path.stat().st_mtime_ns
    return 0


def _timestamp(nanoseconds: int) -> Timestamp:
    timestamp = Timestamp()
    timestamp.FromNanoseconds(nanoseconds)
    return timestamp


def _duration(nanoseconds: int) -> Duration:
    duration = Duration()
    duration.FromNanoseconds(max(nanoseconds, 0))
    return duration
