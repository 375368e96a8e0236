"""Static background: a gradient and the floor's grid, drawn once for each camera and cached."""

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.cameras import Camera
from renderer.opengl import Programs, columns, set_uniforms
from renderer.scene import square_m

FloatArray = NDArray[np.float64]

# The floor is drawn as a line if the view direction's z is below this.
EDGE_ON = 0.05
_LINE_TONE = (0.30, 0.34, 0.39, 0.9)
_MOST = 8
_EXTENT, _SQUARES_PER_LARGE = 6.0, 5


class Backdrops:
    """The backdrops of a drawing's cameras."""

    def __init__(self, context: moderngl.Context, programs: Programs, size: tuple[int, int]) -> None:
        self._context, self._programs, self._size = context, programs, size
        self._gradient = context.vertex_array(programs.backdrop, [])
        self._plane = context.vertex_array(programs.plane, [])
        self._line_buffer = context.buffer(reserve=24)
        self._line = context.vertex_array(programs.edge, [(self._line_buffer, "3f", "position")])
        self._kept: dict[tuple[object, ...], moderngl.Framebuffer] = {}

    def of(
        self,
        camera: Camera,
        site_to_clip: FloatArray,
        *,
        center: FloatArray,
        radius: float,
        floor: float | None,
    ) -> moderngl.Framebuffer:
        """Return the backdrop of a camera, drawn at the first request.

        Args:
            site_to_clip: (4, 4) of the camera.
            center: (3,) centre of the arm's workspace, in the site's frame [m].
            radius: Radius of the workspace [m].
            floor: Height of the floor [m]; None: no floor.
        """
        key = (site_to_clip.tobytes(), floor)
        backdrop = self._kept.pop(key, None)
        if backdrop is None:
            # A camera on a link needs a new backdrop for each picture. The oldest is evicted, so the
            # backdrops of other cameras, which are used more often, stay in the cache.
            backdrop = self._free_framebuffer()
            middle = None if floor is None else np.array([*center[:2], floor])
            self._draw(backdrop, camera, site_to_clip, middle, radius)
        self._kept[key] = backdrop
        return backdrop

    def _free_framebuffer(self) -> moderngl.Framebuffer:
        if len(self._kept) >= _MOST:
            return self._kept.pop(next(iter(self._kept)))
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
