"""Where pictures are drawn: a drawing for each size that is watched, all in one thread.

An OpenGL context belongs to the thread that made it, and drawing must not hold up the event loop.
"""

import contextlib
import os
import threading
import time
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from renderer import cache
from renderer.cameras import Camera, close_up
from renderer.drawing import Drawing
from renderer.mesh import Mesh
from renderer.opengl import open_context
from renderer.overlay import Picture
from renderer.scene import Scene

_NICE = 5
# A size that nobody watches any more is let go: 1920 x 1080 holds a hundred megabytes. The next who watches
# it pays for opening it.
_UNUSED_S = 6.0


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A picture (height, width, 3), its own, the camera that it was drawn by, and what that stands in."""

    picture: Picture
    camera: Camera
    inside: str = ""


@dataclass
class _Open:
    drawing: Drawing
    used: float


class Studio:
    """Draws pictures; every method runs in the studio's own thread."""

    def __init__(
        self, size: tuple[int, int], *, samples: int, shading: str, device: int | None, folder: Path
    ) -> None:
        """Open OpenGL.

        Args:
            size: Most pictures' [px].
            samples: Of anti-aliasing; 0: none.

        Raises:
            NoOpenGLError: If there is none.
        """
        self._size, self._samples, self._folder = size, samples, folder
        self._shading, self._device = shading, device
        self._meshes: dict[str, Mesh] = {}
        self._close_ups: dict[str, Camera] = {}
        self._drawings: dict[tuple[tuple[int, int], int], _Open] = {}
        # At once: a machine without OpenGL must say so at its start.
        self.renderer_name = self._drawing(size, samples).renderer_name

    def take_mesh(self, name: str, glb: bytes, color: str) -> None:
        """Take a link's mesh, unless it is there.

        Raises:
            GlbError: If it is not GLB.
        """
        if name not in self._meshes:
            self._meshes[name] = cache.prepared_once(glb, color=color, folder=self._folder)

    def has_mesh(self, name: str) -> bool:
        """Whether a link's mesh is there."""
        return name in self._meshes

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
            coarse: Without anti-aliasing.
            close_up_of: The camera moves so that the bodies fill this stream's pictures.
        """
        drawing = self._drawing(size, 0 if coarse else self._samples)
        for part in (*scene.parts, *scene.others, *scene.fixtures):
            if not drawing.has(part.mesh) and part.mesh in self._meshes:
                drawing.add(part.mesh, self._meshes[part.mesh])
        if close_up_of is not None:
            camera = self._close_up(drawing, close_up_of, scene, camera)
        # The drawing's own is drawn over next, while this one is still encoded.
        picture = drawing.draw(scene, camera).copy()
        return Drawn(picture=picture, camera=camera, inside=drawing.inside(scene, camera))

    def tidy(self, *, meshes: Collection[str], streams: Collection[str]) -> None:
        """Let go what nobody needs: sizes that were not drawn for a while, meshes, cameras.

        Args:
            meshes: That robots still have.
            streams: That are still there.
        """
        now = time.monotonic()
        for key, opened in list(self._drawings.items()):
            if key[0] != self._size and now - opened.used > _UNUSED_S:
                del self._drawings[key]
                opened.drawing.close()
        gone = self._meshes.keys() - set(meshes)
        for name in gone:
            del self._meshes[name]
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
    """A thread for drawing, or for what comes after."""
    return ThreadPoolExecutor(max_workers=1, thread_name_prefix=name, initializer=_step_back)


def _step_back() -> None:
    """Let everything else on the machine go first: a late picture harms nobody, a late state may.

    The threads that software OpenGL starts from here take it over.
    """
    with contextlib.suppress(AttributeError, OSError):
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICE)
