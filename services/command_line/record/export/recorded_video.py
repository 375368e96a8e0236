"""Export of recorded video as MP4, without a second encode."""

from collections.abc import Iterator
from pathlib import Path

from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from renderer.encoding.mp4 import FragmentedMp4
from robomesh.recordings.h264 import holds_key_frame
from robomesh.recordings.reading import RecordedMessage, RecordingFile
from robomesh.recordings.series.publisher_time import PublisherTimes
from services.command_line.terminal.output import progress
from services.export.errors import ExportError
from services.export.span import Span, decoded, needed


def write_recorded(file: RecordingFile, span: Span, target: Path, view: str) -> tuple[int, float]:
    """Write a view's recorded video from the last key frame before the span; return pictures and seconds.

    Raises:
        ExportError: If the span has no picture of the view.
        Mp4Error: If the video is not H.264, or its format changes.
    """
    topic, mp4 = needed(file, f"video/{view}"), FragmentedMp4()
    with target.open("wb") as stream, progress("video") as report:
        for at_ns, message, picture in recorded_pictures(file, span, topic):
            stream.write(mp4.add(picture.data, at_ns))
            report(span.share(message.received_ns))
    if not mp4.pictures:
        raise ExportError(f"{file.path.name}: no picture of {view!r} in that time")
    return mp4.pictures, mp4.duration_s


def recorded_pictures(
    file: RecordingFile, span: Span, topic: str
) -> Iterator[tuple[int, RecordedMessage, CompressedVideo]]:
    """Yield the pictures from the last key frame before the span, with their publisher's time [ns]."""
    first, times = file.newest(topic, span.start_ns, holds_key_frame), PublisherTimes()
    start_ns = span.start_ns if first is None else first.received_ns
    for message in file.messages([topic], start_ns=start_ns, end_ns=span.end_ns + 1):
        if (picture := decoded(CompressedVideo, message.data)) is not None:
            yield times.of(message), message, picture
