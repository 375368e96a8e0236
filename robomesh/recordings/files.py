"""Description of a recording from its file."""

import contextlib
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path

from google.protobuf.duration_pb2 import Duration
from google.protobuf.message import DecodeError
from google.protobuf.timestamp_pb2 import Timestamp

from robomesh import reason_codes as codes
from robomesh.messages import reason_message
from robomesh.reasons import Reason
from robomesh.recordings.channel_names import ABOUT, LOST
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.layout import Layout, layout_of
from robomesh.recordings.reading import RecordingFile
from robomesh.recordings.records import number_in
from robomesh.schemas import robomesh_pb2 as schema

_CONTROLLER = "/controller"


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
    return recording


def describe_unreadable(path: Path, *, robot: str, problem: Reason) -> schema.Recording:
    """Describe a file that cannot be read, by its name."""
    name = path.stem.partition("Z_")[2] or path.stem
    recording = schema.Recording(robot=robot, name=name, file=path.name, start=_timestamp(_begun_ns(path)))
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
    about, lost = layout.metadata.get(ABOUT, {}), _lost(layout.metadata.get(LOST, {}))
    if not layout.whole and not about and not layout.counts:
        raise RecordingError(codes.RECORDING_CUT(file=path))
    recording = schema.Recording(
        site=about.get("site", ""),
        robot=about.get("robot", ""),
        name=about.get("name", path.stem),
        started_by=about.get("started_by", ""),
        cause=about.get("cause", ""),
        part=number_in(about.get("part", "")),
        recovered=about.get("recovered", "") not in ("", "false"),
        file=path.name,
        start=_timestamp(layout.start_ns or _begun_ns(path)),
        duration=_duration(layout.end_ns - layout.start_ns),
        bytes=size,
        attachments=sorted(layout.attachments),
    )
    if not layout.whole:
        set_problem(recording, codes.RECORDING_KILLED())
    state = _newest_state(path)
    if state.HasField("audit_head"):
        recording.audit_head.CopyFrom(state.audit_head)
    counts = _counts(layout)
    for topic in sorted({*counts, *lost}):
        recording.topics.add(topic=topic, messages=counts.get(topic, 0), lost=lost.get(topic, 0))
    return recording


def _counts(layout: Layout) -> dict[str, int]:
    counts: dict[str, int] = {}
    for number, channel in layout.channels.items():
        if number in layout.counts:
            counts[channel.topic] = counts.get(channel.topic, 0) + layout.counts[number]
    return counts


def _newest_state(path: Path) -> schema.ControllerState:
    """Return the newest state of the controller, which contains the head of the audit log."""
    with RecordingFile(path) as file:
        topics = [topic for topic in file.topics if topic.endswith(_CONTROLLER)]
        try:
            newest = [file.newest(topic, file.layout.end_ns) for topic in topics]
            data = [each.data for each in newest if each is not None]
            return schema.ControllerState.FromString(data[0] if data else b"")
        except (RecordingError, DecodeError):
            return schema.ControllerState()


def _lost(record: dict[str, str]) -> dict[str, int]:
    return {key: number_in(text) for key, text in record.items()}


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
