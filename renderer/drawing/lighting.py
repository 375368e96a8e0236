"""Shadow map of the lamp, for shadows on bodies with full shading."""

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.drawing.body_shaders import KEY
from renderer.drawing.level_of_detail import next_level
from renderer.drawing.opengl import Programs, Uploaded, columns, set_uniforms
from renderer.scene.scene import Part

FloatArray = NDArray[np.float64]

_TEXELS = 640
# Smaller movements do not update the map; as a share of the scene's radius.
_NOTICEABLE = 5e-4
# Largest error of the bodies in the map: less than the distance from which they cast shadows on themselves.
_ERROR = 5e-4


class LampShadow:
    """A map of depths seen from the lamp, redrawn only when something has moved."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self._context, self._programs = context, programs
        self._depths = context.depth_texture((_TEXELS, _TEXELS))
        self._depths.compare_func = "<="
        self._depths.repeat_x = self._depths.repeat_y = False
        self._target = context.framebuffer(depth_attachment=self._depths)
        self._of: tuple[object, ...] | None = None
        self._placements = np.empty((0, 4, 4))

    def light(self, parts: Sequence[tuple[Part, Uploaded]], *, center: FloatArray, radius: float) -> None:
        """Give the body program the shadow of these bodies; redraw the map if they have moved."""
        placements = np.array([part.part_to_site for part, _ in parts]).reshape(-1, 4, 4)
        key = (tuple(part.shape for part, _ in parts), center.tobytes(), radius)
        moved = np.abs(placements - self._placements).max(initial=0.0) if key == self._of else np.inf
        if moved >= _NOTICEABLE * radius:
            self._of, self._placements = key, placements
            self._draw(parts, center, radius)
        self._depths.use(1)
        set_uniforms(self._programs.body, lamp=1, lamp_texel_m=2.0 * radius / _TEXELS)

    def _draw(self, parts: Sequence[tuple[Part, Uploaded]], center: FloatArray, radius: float) -> None:
        matrix = columns(_site_to_lamp(center, radius))
        set_uniforms(self._programs.lamp, site_to_lamp=matrix)
        set_uniforms(self._programs.body, site_to_lamp=matrix)
        self._target.use()
        self._target.clear(depth=1.0)
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.polygon_offset = 1.5, 2.0
        for part, uploaded in parts:
            if uploaded.lamp is not None:
                set_uniforms(self._programs.lamp, part_to_site=columns(part.part_to_site))
                first, end = uploaded.levels[next_level(uploaded.errors, _ERROR * radius, None)]
                uploaded.lamp.render(first=3 * first, vertices=3 * (end - first))
        self._context.polygon_offset = 0.0, 0.0


def _site_to_lamp(center: FloatArray, radius: float) -> FloatArray:
    """Return (4, 4) to the lamp's clip coordinates, which hold a sphere seen along the light."""
    toward = np.array(KEY) / np.linalg.norm(KEY)
    right = np.cross([0.0, 1.0, 0.0], toward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([right, np.cross(toward, right), -toward]) / radius
    matrix[:3, 3] = -matrix[:3, :3] @ center
    return matrix
