"""`robomesh video`: a view's video packets, saved to an MP4 file without a second encode."""

import asyncio
import contextlib
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, BinaryIO

import typer
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from renderer.encoding.mp4 import FragmentedMp4
from renderer.errors import Mp4Error
from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.errors import MessageError
from robomesh.publications.subscription import Subscription
from robomesh.recordings.h264 import is_key_frame
from services.command_line.terminal import discovery
from services.command_line.terminal.options import Connect, Height, Json, Robot, Width, command_group
from services.command_line.terminal.output import print_json, print_line
from services.command_line.watch.views import view_of
from services.errors import ServiceError

app = command_group()

# The renderer sends a view without motion twice a second.
_SILENT_S = 10.0
_NEWEST = 64


class VideoError(ServiceError):
    """No video arrives, or it cannot be written."""


@app.command()
def video(
    robot: Robot,
    view: Annotated[str, typer.Argument(metavar="VIEW", help="front, top, left, free, ...")],
    out: Annotated[Path, typer.Argument(metavar="OUT.mp4")],
    seconds: Annotated[float, typer.Option(metavar="N", help="Length of the video; 0: until Ctrl-C.")] = 0.0,
    width: Width = 0,
    height: Height = 0,
    fps: Annotated[float, typer.Option(help="Highest frame rate; 0: the renderer's own.")] = 0.0,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Save rendered video of a robot, playable while it is written."""
    if out.suffix.lower() != ".mp4":
        raise VideoError(f"{out}: video is written as .mp4")
    if not 0 <= seconds < float("inf"):
        raise VideoError(f"--seconds {seconds:g}: must be 0 (until Ctrl-C) or more")
    file = _File(out)
    try:
        discovery.run(_save(robot, view, file, seconds, connect, width=width, height=height, fps=fps))
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


async def _save(
    name: str, view: str, file: _File, seconds: float, router: str, *, width: int, height: int, fps: float
) -> None:
    async with discovery.attached(router) as session:
        robot = await discovery.find(session, name)
        keys = await view_of(session, robot, view, width=width, height=height, fps=fps)
        file.fps = keys.fps
        video = session.subscribe(keys.video, newest=_NEWEST, history=False)
        taking = asyncio.create_task(_take(video, file, seconds))
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
