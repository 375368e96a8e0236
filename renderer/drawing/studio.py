"""The drawing surfaces, one for each watched size, all in one thread.

An OpenGL context belongs to the thread that made it, and drawing must not block the event loop.
"""

import contextlib
import os
import threading
import time
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.drawing.drawing import Drawing
from renderer.drawing.opengl import open_context
from renderer.scene.cameras import Camera, close_up
from renderer.scene.scene import Scene
from renderer.shapes import cache
from renderer.shapes.prepare import BufferGeometry

_NICE = 5
# A surface that is not used for this time is released: 1920 x 1080 takes a hundred megabytes. The next
# picture of that size has to open it again.
_UNUSED_S = 6.0


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A drawn picture.

    Attributes:
        picture: (height, width, 3).
        camera: The camera that drew it.
        inside: Name of the body that contains the camera; empty if there is none.
    """

    picture: NDArray[np.uint8]
    camera: Camera
    inside: str = ""


@dataclass
class _Open:
    drawing: Drawing
    used: float


class Studio:
    """The drawing surfaces and shapes; every method runs in the drawing thread."""

    def __init__(
        self, size: tuple[int, int], *, samples: int, shading: str, device: int | None, folder: Path
    ) -> None:
        """Open OpenGL.

        Args:
            size: Size of most pictures [px].
            samples: Samples per pixel for anti-aliasing; 0: none.

        Raises:
            NoOpenGLError: If OpenGL cannot be used.
        """
        self._size, self._samples, self._folder = size, samples, folder
        self._shading, self._device = shading, device
        self._shapes: dict[str, BufferGeometry] = {}
        self._close_ups: dict[str, Camera] = {}
        self._drawings: dict[tuple[tuple[int, int], int], _Open] = {}
        # Opened here, so that a machine without OpenGL fails at the start.
        self.renderer_name = self._drawing(size, samples).renderer_name

    def add_shape(self, name: str, glb: bytes, color: str) -> None:
        """Add a link's shape, unless it exists already.

        Raises:
            GlbError: If it is not GLB.
        """
        if name not in self._shapes:
            self._shapes[name] = cache.prepared_once(glb, color=color, folder=self._folder)

    def has_shape(self, name: str) -> bool:
        """Return whether a link's shape has been added."""
        return name in self._shapes

    def draw(
        self,
        scene: Scene,
        camera: Camera,
        *,
        size: tuple[int, int],
        coarse: bool = False,
        close_up_of: str | None = None,
    ) -> Drawn:
        """Draw a scene.

        Args:
            coarse: Draw without anti-aliasing.
            close_up_of: Name of a stream with a camera that moves so that the bodies fill its pictures.
        """
        drawing = self._drawing(size, 0 if coarse else self._samples)
        for part in (*scene.parts, *scene.others, *scene.fixtures):
            if not drawing.has(part.shape) and part.shape in self._shapes:
                drawing.add(part.shape, self._shapes[part.shape])
        if close_up_of is not None:
            camera = self._close_up(drawing, close_up_of, scene, camera)
        picture = drawing.draw(scene, camera)
        return Drawn(picture=picture, camera=camera, inside=drawing.inside(scene, camera))

    def tidy(self, *, shapes: Collection[str], streams: Collection[str]) -> None:
        """Release unused surfaces, shapes and cameras.

        Args:
            shapes: Names of the shapes that robots have.
            streams: Names of the existing streams.
        """
        now = time.monotonic()
        for key, opened in list(self._drawings.items()):
            if key[0] != self._size and now - opened.used > _UNUSED_S:
                del self._drawings[key]
                opened.drawing.close()
        gone = self._shapes.keys() - set(shapes)
        for name in gone:
            del self._shapes[name]
        for opened in self._drawings.values():
            opened.drawing.forget(gone)
        for stream in self._close_ups.keys() - set(streams):
            del self._close_ups[stream]

    def close(self) -> None:
        """Release OpenGL."""
        for opened in self._drawings.values():
            opened.drawing.close()
        self._drawings.clear()

    def _drawing(self, size: tuple[int, int], samples: int) -> Drawing:
        opened = self._drawings.get((size, samples))
        if opened is None:
            context = open_context(self._device)
            drawing = Drawing(context, size, samples=samples, shading=self._shading)
            opened = self._drawings[size, samples] = _Open(drawing, 0.0)
        opened.used = time.monotonic()
        return opened.drawing

    def _close_up(self, drawing: Drawing, stream: str, scene: Scene, camera: Camera) -> Camera:
        camera = self._close_ups.get(stream, camera)
        corners = drawing.corners(scene)
        if corners is not None:
            camera = close_up(camera, drawing.size[0] / drawing.size[1], corners)
        self._close_ups[stream] = camera
        return camera


def open_thread(name: str) -> ThreadPoolExecutor:
    """Return an executor with one low-priority thread, for drawing or encoding."""
    return ThreadPoolExecutor(max_workers=1, thread_name_prefix=name, initializer=_lower_priority)


def _lower_priority() -> None:
    """Lower the thread's priority: a late picture is harmless, a late robot state may not be.

    The threads that software OpenGL starts from here inherit the priority.
    """
    with contextlib.suppress(AttributeError, OSError):
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICE)
