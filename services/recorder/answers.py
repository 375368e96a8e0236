"""What is asked of recordings, answered from their files: in a process of its own, beside the recording."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp

from mcap_files.channel_names import SUFFIX
from mcap_files.errors import RecordingError
from mcap_files.files import describe_file, describe_unreadable
from mcap_files.folder import find_file
from mcap_files.reading import RecordingFile
from mcap_files.series import MOST_POINTS, POINTS, SeriesReader, known_values
from mcap_files.video import holds_key_frame
from robomesh.schemas import robomesh_pb2 as schema

_MESSAGES, _MOST_MESSAGES, _MOST_BYTES = 1000, 10_000, 4 << 20
_PIECE, _MOST_PIECE = 1 << 20, 4 << 20
_VIDEO = "foxglove.CompressedVideo"


@dataclass(frozen=True)
class Question:
    """What a worker is asked; messages as bytes, which are pickled faster."""

    name: str
    request: bytes


class Answers:
    """Answers from the files of a folder; may block on the disk."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._series = SeriesReader()

    def answer(self, question: Question) -> bytes:
        """The answer to a question, as bytes.

        Raises:
            RecordingError: In words for who asked.
        """
        answers: dict[str, tuple[Callable[[Any], Message], Any]] = {
            "list": (self.list, schema.RecordingQuery),
            "info": (self.info, schema.RecordingQuery),
            "range": (self.range, schema.RangeRequest),
            "series": (self.series, schema.SeriesRequest),
            "piece": (self.piece, schema.PieceRequest),
        }
        answer, request = answers[question.name]
        return answer(request.FromString(question.request)).SerializeToString()

    def list(self, _: schema.RecordingQuery) -> schema.RecordingList:
        """Every recording, newest first; what cannot be read is told with the reason."""
        recordings = schema.RecordingList()
        paths = [*self._folder.glob(f"*/*{SUFFIX}"), *self._folder.glob(f"*{SUFFIX}")]
        for path in sorted(paths, key=lambda path: path.name, reverse=True):
            try:
                recordings.recordings.append(describe_file(path))
            except RecordingError as error:
                robot = path.parent.name if path.parent != self._folder else ""
                recordings.recordings.append(describe_unreadable(path, robot=robot, problem=str(error)))
        if self._folder.is_dir():
            recordings.free_bytes = shutil.disk_usage(self._folder).free
        return recordings

    def info(self, asked: schema.RecordingQuery) -> schema.Recording:
        """What one recording holds."""
        return describe_file(find_file(self._folder, asked.file))

    def range(self, asked: schema.RangeRequest) -> schema.RecordedMessages:
        """Messages of one topic."""
        most = min(asked.most or _MESSAGES, _MOST_MESSAGES)
        with RecordingFile(find_file(self._folder, asked.file)) as file:
            start_ns, end_ns = _times(file, asked)
            answer = schema.RecordedMessages(schema=file.schema_name(asked.topic))
            if asked.from_key_frame and answer.schema == _VIDEO:
                key_frame = file.newest(asked.topic, start_ns, holds_key_frame)
                start_ns = start_ns if key_frame is None else key_frame.received_ns
            taken = 0
            messages = file.messages([asked.topic], start_ns=start_ns, end_ns=end_ns + 1)
            for message in islice(messages, asked.skip, None):
                taken += len(message.data)
                if answer.messages and (len(answer.messages) >= most or taken > _MOST_BYTES):
                    answer.more = True
                    break
                added = answer.messages.add(sequence=message.sequence, data=message.data)
                added.received.FromNanoseconds(message.received_ns)
                added.source.FromNanoseconds(message.source_ns)
            return answer

    def series(self, asked: schema.SeriesRequest) -> schema.SeriesAnswer:
        """Values over time; without names, which there are."""
        with RecordingFile(find_file(self._folder, asked.file)) as file:
            if not asked.values:
                return schema.SeriesAnswer(known=known_values(file))
            start_ns, end_ns = _times(file, asked)
            points = min(asked.points or POINTS, MOST_POINTS)
            answer = schema.SeriesAnswer()
            for each in self._series.read(
                file, asked.values, start_ns=start_ns, end_ns=end_ns, points=points
            ):
                answer.series.add(
                    name=each.name,
                    unit=each.unit,
                    times_s=each.times_s.tolist(),
                    lowest=each.lowest.tolist(),
                    highest=each.highest.tolist(),
                )
            return answer

    def piece(self, asked: schema.PieceRequest) -> schema.Piece:
        """Bytes of a file, or of something attached to it."""
        path = find_file(self._folder, asked.file)
        length = min(asked.length or _PIECE, _MOST_PIECE)
        with path.open("rb") as stream:
            answer = schema.Piece(version=version_of(path), media_type="application/octet-stream")
            begin, answer.total = 0, path.stat().st_size
            if asked.attachment:
                with RecordingFile(path) as file:
                    attached = file.attached(asked.attachment)
                begin, answer.total = attached.offset, attached.length
                answer.media_type = attached.media_type or answer.media_type
            if asked.offset > answer.total:
                raise RecordingError(f"{asked.file}: no byte {asked.offset}: it has {answer.total}")
            stream.seek(begin + asked.offset)
            answer.data = stream.read(min(length, answer.total - asked.offset))
            return answer


def version_of(path: Path) -> str:
    """Which file it is now: one that only grew keeps it, one that was written again does not."""
    with RecordingFile(path) as file:
        found = path.stat()
        state = f"{found.st_size:x}-{found.st_mtime_ns:x}" if file.layout.whole else "open"
        return f"{found.st_ino:x}-{file.layout.start_ns:x}-{state}"


def _times(file: RecordingFile, asked: schema.RangeRequest | schema.SeriesRequest) -> tuple[int, int]:
    """What was asked for, within the recording, both ends included."""
    first, last = file.layout.start_ns, file.layout.end_ns
    try:
        start_ns = asked.start.ToNanoseconds() if asked.HasField("start") else first
        end_ns = asked.end.ToNanoseconds() if asked.HasField("end") else last
    except ValueError as error:
        raise RecordingError(f"{file.path.name}: no time that there is: {error}") from None
    if asked.HasField("start") and asked.HasField("end") and end_ns < start_ns:
        raise RecordingError("the range ends before it begins")
    if last and (start_ns > last or end_ns < first):
        raise RecordingError(
            f"{file.path.name}: nothing from {_text(start_ns)} to {_text(end_ns)}: "
            f"it goes from {_text(first)} to {_text(last)}"
        )
    return max(start_ns, first), min(end_ns, last)


def _text(time_ns: int) -> str:
    timestamp = Timestamp()
    timestamp.FromNanoseconds(time_ns)
    return timestamp.ToJsonString()
