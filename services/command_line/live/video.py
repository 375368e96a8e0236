"""`robomesh video`: a view's video packets, saved to an MP4 file without a second encode."""

import asyncio
import contextlib
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from renderer.encoding.mp4 import FragmentedMp4
from renderer.errors import Mp4Error
from robomesh.errors import MessageError
from robomesh.publications.subscription import Subscription
from robomesh.recordings.h264 import is_key_frame
from services.command_line.live.views import view_of
from services.command_line.terminal import discovery
from services.command_line.terminal.output import print_json, print_line
from services.errors import ServiceError

# The renderer sends a view without motion twice a second.
_SILENT_S = 10.0
_NEWEST = 64


class VideoError(ServiceError):
    """No video arrives, or it cannot be written."""


@dataclass(frozen=True)
class Wanted:
    """The requested length, size and rate; 0: until Ctrl-C, and the renderer's own."""

    seconds: float = 0.0
    width: int = 0
    height: int = 0
    fps: float = 0.0


def run(robot: str, view: str, out: Path, wanted: Wanted, router: str, as_json: bool) -> None:
    """Save video for the requested time, or until Ctrl-C."""
    if out.suffix.lower() != ".mp4":
        raise VideoError(f"{out}: video is written as .mp4")
    if not 0 <= wanted.seconds < float("inf"):
        raise VideoError(f"--seconds {wanted.seconds:g}: must be 0 (until Ctrl-C) or more")
    file = _File(out)
    try:
        discovery.run(_save(robot, view, file, wanted, router))
    except (Mp4Error, VideoError) as error:
        raise VideoError(f"{error}; {file.words}") from None
    finally:
        file.close()
    if as_json:
        print_json(
            {
                "file": str(out),
                "pictures": file.mp4.pictures,
                "duration_s": file.mp4.duration_s,
                "pictures_per_s": file.pictures_per_s,
                "most_pictures_per_s": file.fps,
                "bytes": file.bytes,
            }
        )
    else:
        print_line(file.words)


class _File:
    """The MP4 file: created with the first picture, and playable from then on.

    Attributes:
        fps: Highest rate of the view [1/s]; 0: unknown.
    """

    def __init__(self, path: Path) -> None:
        self.mp4 = FragmentedMp4()
        self.bytes = 0
        self.fps = 0.0
        self._path = path
        self._file: BinaryIO | None = None

    @property
    def words(self) -> str:
        """Describe what was written."""
        if not self.bytes:
            return "nothing was written"
        most = f" (up to {self.fps:g} while it moves)" if self.fps else ""
        return (
            f"{self._path}: {self.mp4.duration_s:.1f} s, {self.mp4.pictures} pictures, "
            f"{self.pictures_per_s:.1f} a second{most}, {self.bytes / 1e6:.2f} MB"
        )

    @property
    def pictures_per_s(self) -> float:
        """Mean rate of the written pictures [1/s]."""
        return self.mp4.pictures / self.mp4.duration_s if self.mp4.pictures else 0.0

    def add(self, packet: bytes, time_ns: int) -> None:
        data = self.mp4.add(packet, time_ns)
        if not data:
            return
        try:
            if self._file is None:
                self._file = self._path.open("wb")
            self._file.write(data)
            self._file.flush()
        except OSError as error:
            raise VideoError(f"{self._path}: cannot be written: {error.strerror}") from None
        self.bytes += len(data)

    def close(self) -> None:
        if self._file is not None:
            with contextlib.suppress(OSError):
                self._file.close()


async def _save(name: str, view: str, file: _File, wanted: Wanted, router: str) -> None:
    async with discovery.attached(router) as session:
        robot = await discovery.find(session, name)
        keys = await view_of(session, robot, view, width=wanted.width, height=wanted.height, fps=wanted.fps)
        file.fps = keys.fps
        video = session.subscribe(keys.video, newest=_NEWEST, history=False)
        taking = asyncio.create_task(_take(video, file, wanted.seconds))
        with _on_interrupt(taking):
            await asyncio.wait([taking])
        video.close()
        if not taking.cancelled():
            taking.result()


async def _take(video: Subscription, file: _File, seconds: float) -> None:
    lost, whole = 0, True
    while not seconds or file.mp4.duration_s < seconds:
        try:
            async with asyncio.timeout(_SILENT_S):
                sample = await anext(video)
                message = sample.message()
        except TimeoutError:
            raise VideoError(f"no picture arrived for {_SILENT_S:g} s") from None
        except MessageError:
            continue
        if not isinstance(message, CompressedVideo):
            continue
        # After a gap, packets cannot be decoded correctly until the next key frame.
        missed = video.missed(sample.key)
        whole = (whole and missed == lost) or is_key_frame(message.data)
        lost = missed
        if whole:
            file.add(message.data, round(sample.received * 1e9))


@contextlib.contextmanager
def _on_interrupt(task: asyncio.Task[None]) -> Iterator[None]:
    """Cancel the task on the first Ctrl-C; a second one ends the program."""
    loop = asyncio.get_running_loop()

    def end(number: int) -> None:
        task.cancel()
        loop.remove_signal_handler(number)

    numbers = (signal.SIGINT, signal.SIGTERM)
    for number in numbers:
        loop.add_signal_handler(number, end, number)
    try:
        yield
    finally:
        for number in numbers:
            loop.remove_signal_handler(number)
