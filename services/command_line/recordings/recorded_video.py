"""Export of recorded video as MP4, without a second encode."""

from pathlib import Path

from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from renderer.mp4 import FragmentedMp4
from robomesh.recordings.publisher_time import PublisherTimes
from robomesh.recordings.reading import RecordingFile
from robomesh.recordings.video import holds_key_frame
from services.command_line.recordings.errors import ExportError
from services.command_line.recordings.output import progress
from services.command_line.recordings.span import Span, decoded, needed


def write_recorded(file: RecordingFile, span: Span, target: Path, view: str) -> tuple[int, float]:
    """Write a view's recorded video from the last key frame before the span; return pictures and seconds.

    Raises:
        ExportError: If the span has no picture of the view.
        Mp4Error: If the video is not H.264, or its format changes.
    """
    topic = needed(file, f"video/{view}")
    first = file.newest(topic, span.start_ns, holds_key_frame)
    start_ns = span.start_ns if first is None else first.received_ns
    mp4, times = FragmentedMp4(), PublisherTimes()
    with target.open("wb") as stream, progress("video") as report:
        for message in file.messages([topic], start_ns=start_ns, end_ns=span.end_ns + 1):
            picture = decoded(CompressedVideo, message.data)
            if picture is None:
                continue
            stream.write(mp4.add(picture.data, times.of(message)))
            report(span.share(message.received_ns))
    if not mp4.pictures:
        raise ExportError(f"{file.path.name}: no picture of {view!r} in that time")
    return mp4.pictures, mp4.duration_s
