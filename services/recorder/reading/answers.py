"""Answers to requests about recordings, read from the files in a separate process."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from google.protobuf.message import Message

from robomesh import reason_codes as codes
from robomesh.recordings.changes import (
    CHANGES,
    DamagedChangesError,
    is_deleted,
    read_changes,
    recording_path,
)
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.files import describe_deleted, describe_file, describe_unreadable
from robomesh.recordings.h264 import holds_key_frame
from robomesh.recordings.names import SUFFIX, files_in, find_file, robot_of
from robomesh.recordings.reading import RecordingFile
from robomesh.recordings.series.downsampling import MOST_POINTS, POINTS, SeriesReader, known_values
from robomesh.schemas import robomesh_pb2 as schema
from services.recorder.reading.robot_series import RobotSeries

_MESSAGES, _MOST_MESSAGES, _MOST_BYTES = 1000, 10_000, 4 << 20
_PIECE, _MOST_PIECE = 1 << 20, 4 << 20
_VIDEO = "foxglove.CompressedVideo"


@dataclass(frozen=True)
class Question:
    """A question to a worker; the message is serialized because bytes are pickled faster."""

    name: str
    request: bytes


class Answers:
    """Answers from the recordings of a folder; methods may block on the disk."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._series = SeriesReader()
        self._robots = RobotSeries(folder)

    def answer(self, question: Question) -> bytes:
        """Return the serialized answer to a question.

        Raises:
            RecordingError: If it cannot be answered; the text is for the client.
        """
        answers: dict[str, tuple[Callable[[Any], Message], Any]] = {
            "list": (self.list, schema.RecordingListQuery),
            "info": (self.info, schema.RecordingQuery),
            "range": (self.range, schema.RangeRequest),
            "series": (self.series, schema.SeriesRequest),
            "piece": (self.piece, schema.PieceRequest),
        }
        answer, request = answers[question.name]
        return answer(request.FromString(question.request)).SerializeToString()

    def list(self, query: schema.RecordingListQuery) -> schema.RecordingList:
        """List every recording, newest first; an unreadable file has its problem as text."""
        recordings = schema.RecordingList()
        paths = files_in(self._folder, f"*{SUFFIX}")
        for path in sorted(paths, key=lambda path: path.name, reverse=True):
            try:
                recordings.recordings.append(describe_file(path))
            except RecordingError as error:
                robot = robot_of(self._folder, path)
                recordings.recordings.append(describe_unreadable(path, robot=robot, problem=error.reason))
        for recording in recordings.recordings:
            del recording.history[:]
        if query.deleted:
            recordings.recordings.extend(self._deleted())
        if self._folder.is_dir():
            recordings.free_bytes = shutil.disk_usage(self._folder).free
        return recordings

    def _deleted(self) -> Iterator[schema.Recording]:
        for path in files_in(self._folder, f"*{CHANGES}"):
            recording = recording_path(path)
            with suppress(DamagedChangesError):
                changes = read_changes(recording)
                if is_deleted(changes) and not recording.exists():
                    yield describe_deleted(recording, changes, robot=robot_of(self._folder, recording))

    def info(self, request: schema.RecordingQuery) -> schema.Recording:
        """Describe one recording."""
        return describe_file(find_file(self._folder, request.file))

    def range(self, request: schema.RangeRequest) -> schema.RecordedMessages:
        """Return messages of one topic."""
        most = min(request.most or _MESSAGES, _MOST_MESSAGES)
        with RecordingFile(find_file(self._folder, request.file)) as file:
            start_ns, end_ns = _times(file, request)
            answer = schema.RecordedMessages(schema=file.schema_name(request.topic))
            if request.from_key_frame and answer.schema == _VIDEO:
                key_frame = file.newest(request.topic, start_ns, holds_key_frame)
                start_ns = start_ns if key_frame is None else key_frame.received_ns
            taken = 0
            messages = file.messages([request.topic], start_ns=start_ns, end_ns=end_ns + 1)
            for message in islice(messages, request.skip, None):
                taken += len(message.data)
                if answer.messages and (len(answer.messages) >= most or taken > _MOST_BYTES):
                    answer.more = True
                    break
                added = answer.messages.add(sequence=message.sequence, data=message.data)
                added.received.FromNanoseconds(message.received_ns)
                added.source.FromNanoseconds(message.source_ns)
            return answer

    def series(self, request: schema.SeriesRequest) -> schema.SeriesAnswer:
        """Return values over time, or the known value names if the request names none."""
        if request.robot:
            return self._robots.read(request)
        with RecordingFile(find_file(self._folder, request.file)) as file:
            if not request.values:
                return schema.SeriesAnswer(known=known_values(file))
            start_ns, end_ns = _times(file, request)
            points = min(request.points or POINTS, MOST_POINTS)
            answer = schema.SeriesAnswer()
            for each in self._series.read(
                file, request.values, start_ns=start_ns, end_ns=end_ns, points=points
            ):
                answer.series.add(
                    name=each.name,
                    unit=each.unit,
                    times_s=each.times_s.tolist(),
                    lowest=each.lowest.tolist(),
                    highest=each.highest.tolist(),
                )
            return answer

    def piece(self, request: schema.PieceRequest) -> schema.Piece:
        """Return bytes of a file or of one of its attachments."""
        path = find_file(self._folder, request.file)
        length = min(request.length or _PIECE, _MOST_PIECE)
        with path.open("rb") as stream:
            answer = schema.Piece(version=version_of(path), media_type="application/octet-stream")
            begin, answer.total = 0, path.stat().st_size
            if request.attachment:
                with RecordingFile(path) as file:
                    attached = file.attached(request.attachment)
                begin, answer.total = attached.offset, attached.length
                answer.media_type = attached.media_type or answer.media_type
            if request.offset > answer.total:
                raise RecordingError(
                    codes.RECORDING_NO_BYTE(file=request.file, byte=request.offset, total=answer.total)
                )
            stream.seek(begin + request.offset)
            answer.data = stream.read(min(length, answer.total - request.offset))
            return answer


def version_of(path: Path) -> str:
    """Return a version of the file's contents: growth keeps it, a rewrite changes it."""
    with RecordingFile(path) as file:
        found = path.stat()
        state = f"{found.st_size:x}-{found.st_mtime_ns:x}" if file.layout.whole else "open"
        return f"{found.st_ino:x}-{file.layout.start_ns:x}-{state}"


def _times(file: RecordingFile, request: schema.RangeRequest | schema.SeriesRequest) -> tuple[int, int]:
    """Return the requested times clipped to the recording [ns], both ends included.

    Raises:
        RecordingError: If the range is invalid or outside the recording.
    """
    try:
        start_ns = request.start.ToNanoseconds() if request.HasField("start") else None
        end_ns = request.end.ToNanoseconds() if request.HasField("end") else None
    except ValueError as error:
        raise RecordingError(f"{file.path.name}: invalid time: {error}") from None
    return file.clip(start_ns, end_ns)
