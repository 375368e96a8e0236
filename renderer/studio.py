"""Where pictures are made: one drawing and an encoder a stream, all in one thread.

An OpenGL context belongs to the thread that made it, and drawing must not hold up the event loop.
"""

import contextlib
import os
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from renderer import cache
from renderer.cameras import Camera, close_up
from renderer.drawing import Drawing
from renderer.encoder import Packet, VideoEncoder, jpeg, open_encoder
from renderer.errors import NoEncoderError
from renderer.opengl import open_context
from renderer.overlay import Overlay, write_over
from renderer.scene import Scene

_NICE = 5


@dataclass(frozen=True, kw_only=True)
class Job:
    """A picture to be made.

    Attributes:
        stream: The video stream that it belongs to.
        follow: Whether the camera moves so that the bodies fill the picture.
        video: Encode it for the stream.
        key_frame: As a key frame.
        image: Encode it as JPEG.
    """

    stream: str
    scene: Scene
    camera: Camera
    overlay: Overlay
    follow: bool = False
    video: bool = False
    key_frame: bool = False
    image: bool = False


@dataclass(frozen=True)
class Painted:
    """What came out of a job."""

    packet: Packet | None
    jpeg: bytes | None


class Studio:
    """Makes pictures; every method runs in the studio's own thread."""

    def __init__(
        self, size: tuple[int, int], fps: float, *, samples: int, device: int | None, folder: Path
    ) -> None:
        """Open OpenGL.

        Raises:
            NoOpenGLError: If there is none.
            NoEncoderError: If no H.264 encoder works.
        """
        self._size, self._fps, self._folder = size, fps, folder
        self._drawing = Drawing(open_context(device), size, samples=samples)
        self._close_ups: dict[str, Camera] = {}
        self._encoders: dict[str, VideoEncoder] = {}
        # Tried before anybody watches: a machine without an encoder must say so at its start.
        self.encoder_name = open_encoder(size, fps).name

    @property
    def renderer_name(self) -> str:
        """What draws, in the driver's words."""
        return self._drawing.renderer_name

    def take_mesh(self, name: str, glb: bytes, color: str) -> None:
        """Take a link's mesh, unless it is there.

        Raises:
            GlbError: If it is not GLB.
        """
        if not self._drawing.has(name):
            self._drawing.add(name, cache.prepared_once(glb, color=color, folder=self._folder))

    def has_mesh(self, name: str) -> bool:
        """Whether a link's mesh is there."""
        return self._drawing.has(name)

    def paint(self, job: Job) -> Painted:
        """Draw, write over, encode.

        Raises:
            NoEncoderError: If the stream's encoder failed; the next picture gets a new one.
        """
        picture = self._drawing.draw(job.scene, self._close_up(job) if job.follow else job.camera)
        write_over(picture, job.overlay)
        packet = None
        if job.video:
            encoder = self._encoders.get(job.stream)
            if encoder is None:
                encoder = self._encoders[job.stream] = open_encoder(self._size, self._fps)
            try:
                packet = encoder.encode(picture, key_frame=job.key_frame)
            except NoEncoderError:
                del self._encoders[job.stream]
                raise
        return Painted(packet, jpeg(picture) if job.image else None)

    def _close_up(self, job: Job) -> Camera:
        camera = self._close_ups.get(job.stream, job.camera)
        corners = self._drawing.corners(job.scene)
        if corners is not None:
            camera = close_up(camera, self._size[0] / self._size[1], corners)
        self._close_ups[job.stream] = camera
        return camera

    def close(self) -> None:
        """Release OpenGL and the encoders."""
        self._encoders.clear()
        self._drawing.close()


def open_thread() -> ThreadPoolExecutor:
    """The thread that a studio lives in."""
    return ThreadPoolExecutor(max_workers=1, thread_name_prefix="renderer", initializer=_step_back)


def _step_back() -> None:
    """Let everything else on the machine go first: a late picture harms nobody, a late state may.

    The threads that software OpenGL starts from here take it over.
    """
    with contextlib.suppress(AttributeError, OSError):
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICE)
