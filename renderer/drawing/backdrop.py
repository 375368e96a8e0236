"""Static background: a gradient and the floor's grid, kept for each camera that stands still."""

import time
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.drawing.opengl import Programs, columns, set_uniforms
from renderer.scene.cameras import Camera
from renderer.scene.scene import square_m

FloatArray = NDArray[np.float64]

# The floor is drawn as a line if the view direction's z is below this.
EDGE_ON = 0.05
_LINE_TONE = (0.30, 0.34, 0.39, 0.9)
# Largest memory of the kept backdrops: 145 of 1280 x 720. It is taken only by cameras that draw.
_MOST_BYTES = 512 << 20
# A backdrop is replaced once it was not used for this time [s], and not before: views that take turns would
# otherwise push each other out, and redraw all backdrops.
_UNUSED_S = 30.0
_MOST_NEW = 512
_EXTENT, _SQUARES_PER_LARGE = 6.0, 5


class _Kept(NamedTuple):
    framebuffer: moderngl.Framebuffer
    used_at: float


class Backdrops:
    """The backdrops of a drawing's cameras."""

    def __init__(self, context: moderngl.Context, programs: Programs, size: tuple[int, int]) -> None:
        self._context, self._programs, self._size = context, programs, size
        self._gradient = context.vertex_array(programs.backdrop, [])
        self._plane = context.vertex_array(programs.plane, [])
        self._line_buffer = context.buffer(reserve=24)
        self._line = context.vertex_array(programs.edge, [(self._line_buffer, "3f", "position")])
        # In the order of their last use.
        self._kept: dict[tuple[object, ...], _Kept] = {}
        self._most = max(_MOST_BYTES // (size[0] * size[1] * 4), 1)
        # Cameras that were asked for once: one on a link moves, and needs a new backdrop for each picture.
        self._new: dict[tuple[object, ...], None] = {}
        self._not_kept: moderngl.Framebuffer | None = None

    def of(
        self,
        camera: Camera,
        site_to_clip: FloatArray,
        *,
        center: FloatArray,
        radius: float,
        floor: float | None,
    ) -> moderngl.Framebuffer:
        """Return the backdrop of a camera; the next call may change one that is not kept.

        Args:
            site_to_clip: (4, 4) of the camera.
            center: (3,) centre of the arm's workspace, in the site's frame [m].
            radius: Radius of the workspace [m].
            floor: Height of the floor [m]; None: no floor.
        """
        key, now = (site_to_clip.tobytes(), floor), time.monotonic()
        kept = self._kept.pop(key, None)
        if kept is None:
            place = self._place(key, now)
            framebuffer = self._temporary() if place is None else place
            middle = None if floor is None else np.array([*center[:2], floor])
            self._draw(framebuffer, camera, site_to_clip, middle, radius)
            if place is None:
                return framebuffer
            kept = _Kept(framebuffer, now)
        self._kept[key] = kept._replace(used_at=now)
        return kept.framebuffer

    def _place(self, key: tuple[object, ...], now: float) -> moderngl.Framebuffer | None:
        """Return where to keep a camera's backdrop; None: it is not kept."""
        if key not in self._new:
            if len(self._new) >= _MOST_NEW:
                del self._new[next(iter(self._new))]
            self._new[key] = None
            return None
        oldest = next(iter(self._kept), None)
        if oldest is not None and now - self._kept[oldest].used_at > _UNUSED_S:
            return self._kept.pop(oldest).framebuffer
        return self._framebuffer() if len(self._kept) < self._most else None

    def _temporary(self) -> moderngl.Framebuffer:
        self._not_kept = self._not_kept or self._framebuffer()
        return self._not_kept

    def _framebuffer(self) -> moderngl.Framebuffer:
        return self._context.framebuffer([self._context.renderbuffer(self._size, 4)])

    def _draw(
        self,
        target: moderngl.Framebuffer,
        camera: Camera,
        site_to_clip: FloatArray,
        middle: FloatArray | None,
        radius: float,
    ) -> None:
        """Draw gradient and grid; a floor seen edge-on is a line, with the grid upright behind it."""
        forward = camera.forward
        target.use()
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        # A view from above has no horizon, so it gets no gradient.
        set_uniforms(self._programs.backdrop, level=1.0 - abs(float(forward[2])) ** 4)
        self._gradient.render(vertices=3)
        if middle is None:
            return
        edge_on = camera.orthographic and abs(forward[2]) < EDGE_ON
        extent, square = _EXTENT * radius, square_m(radius)
        coarse = _SQUARES_PER_LARGE * square
        # The grid is fixed in the site, independent of the scene's centre.
        floor = np.array([*np.round(middle[:2] / coarse) * coarse, middle[2]])
        up = np.array([0.0, 0.0, 1.0])
        origin, u, v = floor, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
        if edge_on:
            origin, u, v = floor + forward * 3.5 * radius, np.cross(forward, up), up
        set_uniforms(
            self._programs.plane,
            site_to_clip=columns(site_to_clip),
            origin=tuple(origin),
            u=tuple(u),
            v=tuple(v),
            extent=extent,
            drawn=(-1.0, -1.0, 1.0, 1.0),
            fine=square,
            coarse=coarse,
            strength=0.7 if edge_on else 1.0,
            floor_light=0.0 if edge_on else 1.0,
        )
        self._plane.render(moderngl.TRIANGLE_STRIP, vertices=4)
        if edge_on:
            ends = np.array([origin - u * extent, origin + u * extent], dtype=np.float32)
            self._line_buffer.write(ends.tobytes())
            set_uniforms(
                self._programs.edge,
                site_to_clip=columns(site_to_clip),
                part_to_site=columns(np.eye(4)),
                tone=_LINE_TONE,
            )
            self._context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
            self._line.render(moderngl.LINES)
