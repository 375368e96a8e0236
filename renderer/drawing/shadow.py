"""The soft shadow on the floor: sharp below low bodies, wide and faint below high ones."""

import math
from collections.abc import Sequence

import cv2
import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.drawing.body_shaders import KEY
from renderer.drawing.opengl import Programs, Uploaded, columns, set_uniforms
from renderer.scene.scene import Part

FloatArray = NDArray[np.float32]

_TEXELS = 160
# Value of the shadow map where no body is above the floor [m], and a height above every body.
NOTHING = 1e6
_ANY_HEIGHT = 1e3
# Extent of the map, and the smallest movement that updates it, over the scene's radius.
_EXTENT, _NOTICEABLE = 1.6, 0.002

# (upper height, blur width, darkness) of each layer; heights and widths over the scene's radius.
_LAYERS = (
    (0.035, 0.018, 0.62),
    (0.16, 0.030, 0.50),
    (0.45, 0.050, 0.46),
    (_ANY_HEIGHT, 0.080, 0.42),
)
# From here on a shadow's edge is darker by less than a level, over the scene's radius.
_WIDEST = 3.0 * max(width for _, width, _ in _LAYERS)


class FloorShadow:
    """The shadow of a scene's bodies, recomputed only after a noticeable movement."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self._context, self._programs = context, programs
        n = _TEXELS
        self._heights = context.framebuffer(
            [context.renderbuffer((n, n), 1, dtype="f4")], context.depth_renderbuffer((n, n))
        )
        self._shadow = context.texture((n, n), 1, dtype="f1")
        self._shadow.repeat_x = self._shadow.repeat_y = False
        self._plane = context.vertex_array(programs.shade, [])
        self._of: tuple[object, ...] | None = None
        self._placements = np.empty((0, 4, 4))
        self._drawn = (-1.0, -1.0, 1.0, 1.0)

    def forget(self) -> None:
        """Recompute the shadow next time."""
        self._of = None

    def cast(
        self,
        parts: Sequence[tuple[Part, Uploaded]],
        *,
        center: NDArray[np.float64],
        radius: float,
        floor: float,
    ) -> None:
        """Compute the shadow of these bodies, unless it is up to date.

        Args:
            center: (3,) centre of the scene and of the shadow map [m].
            radius: Radius of the scene [m].
            floor: Height of the floor [m].
        """
        placements = np.array([part.part_to_site for part, _ in parts]).reshape(-1, 4, 4)
        key = (tuple(part.shape for part, _ in parts), center.tobytes(), radius, floor)
        if key == self._of and np.abs(placements - self._placements).max(initial=0.0) < _NOTICEABLE * radius:
            return
        self._of, self._placements = key, placements
        extent = _EXTENT * radius
        self._heights.use()
        self._heights.clear(NOTHING, depth=1.0)
        self._context.enable_only(moderngl.DEPTH_TEST)
        set_uniforms(
            self._programs.cast,
            center=tuple(center[:2]),
            extent=extent,
            floor_height=floor,
            tallest=4.0 * radius,
            key=KEY,
        )
        for part, uploaded in parts:
            if uploaded.shadow is not None:
                set_uniforms(self._programs.cast, part_to_site=columns(part.part_to_site))
                uploaded.shadow.render()
        n = _TEXELS
        heights = np.frombuffer(self._heights.read(components=1, dtype="f4"), dtype=np.float32).reshape(n, n)
        texel = 2.0 * extent / n / radius
        # Only the part with shadow is computed and drawn: most of the floor has none.
        along, across = _around(heights < NOTHING, math.ceil(_WIDEST / texel))
        dark = soft_shadow(heights[along, across] / radius, texel=texel) * _FADE[along, across]
        levels = np.zeros((n, n), dtype=np.uint8)
        levels[along, across] = np.clip(dark, 0.0, 1.0) * 255.0
        self._shadow.write(levels.tobytes())
        along, across = _around(levels > 0, 1)
        corners = np.array([across.start, along.start, across.stop, along.stop])
        self._drawn = tuple((corners / n * 2.0 - 1.0).tolist())

    def lay(
        self, site_to_clip: NDArray[np.float64], *, center: NDArray[np.float64], radius: float, floor: float
    ) -> None:
        """Darken the floor in the framebuffer in use."""
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._shadow.use(0)
        set_uniforms(
            self._programs.shade,
            site_to_clip=columns(site_to_clip),
            origin=(*center[:2], floor),
            u=(1.0, 0.0, 0.0),
            v=(0.0, 1.0, 0.0),
            extent=_EXTENT * radius,
            drawn=self._drawn,
        )
        self._plane.render(moderngl.TRIANGLE_STRIP, vertices=4)


def _around(filled: NDArray[np.bool_], edge: int) -> tuple[slice, slice]:
    """Return the rows and columns of the filled texels and of `edge` texels around them."""

    def span(other_axis: int) -> slice:
        places = np.flatnonzero(filled.any(axis=other_axis))
        if not len(places):
            return slice(0, 0)
        return slice(max(int(places[0]) - edge, 0), min(int(places[-1]) + 1 + edge, _TEXELS))

    return span(1), span(0)


def _fade() -> FloatArray:
    """Return the share of the shadow by texel: it fades out towards the map's edge, without corners."""
    middles = (np.arange(_TEXELS) + 0.5) / _TEXELS * 2.0 - 1.0
    beyond = np.clip((np.hypot(*np.meshgrid(middles, middles)) - 0.8) / 0.2, 0.0, 1.0)
    return (1.0 - beyond * beyond * (3.0 - 2.0 * beyond)).astype(np.float32)


_FADE = _fade()


def soft_shadow(heights: FloatArray, *, texel: float) -> FloatArray:
    """Return the (n, n) darkness of the floor, 0 to 1.

    A large lamp's shadow gets wider and fainter with the height of the body, so each layer of heights is
    blurred with its width, and the layers are combined.

    Args:
        heights: (n, n) height of the lowest body above each texel, over the scene's radius;
            `NOTHING` where there is none.
        texel: Width of a texel, over the scene's radius.
    """
    light = np.ones_like(heights)
    bottom = 0.0
    for top, width, dark in _LAYERS:
        inside = (heights >= bottom) & (heights < top)
        if inside.any():
            light *= 1.0 - dark * cv2.GaussianBlur(inside.astype(np.float32), (0, 0), width / texel)
        bottom = top
    return 1.0 - light
