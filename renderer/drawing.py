"""Drawing a scene: backdrop and grid, the floor's shadow, the bodies over them.

What does not move is drawn once a camera. Only the bodies need several samples a pixel, and only
the rectangle of the picture that they fill is drawn and resolved: on software OpenGL that halves
the time.
"""

from collections.abc import Iterable

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.cameras import Camera, site_to_clip
from renderer.mesh import Mesh
from renderer.opengl import Uploaded, columns, compile_programs, set_uniforms, upload
from renderer.scene import Part, Scene
from renderer.shadow import NOTHING, soft_shadow

Picture = NDArray[np.uint8]
FloatArray = NDArray[np.float64]

_SHADOW_TEXELS = 160
_EDGE_TONE = (0.07, 0.08, 0.10, 0.42)
_LINE_TONE = (0.30, 0.34, 0.39, 0.9)
_STALE_OPACITY = 0.66
# Seen so flat, the floor is a line.
_EDGE_ON = 0.05
_MOST_BACKDROPS = 16


class Drawing:
    """Draws scenes of the meshes that it was given, at one size, in the context's thread.

    Attributes:
        renderer_name: What draws, in the driver's words.
    """

    def __init__(self, context: moderngl.Context, size: tuple[int, int], *, samples: int = 4) -> None:
        self.context = context
        self.size = size
        self.renderer_name = str(context.info["GL_RENDERER"])
        samples = min(samples, context.max_samples)
        self._programs = compile_programs(context, samples=samples)
        self._bodies_layer = context.texture(size, 4, samples=samples)
        self._bodies = context.framebuffer(
            [self._bodies_layer], context.depth_renderbuffer(size, samples=samples)
        )
        self._final = context.framebuffer([context.renderbuffer(size, 4)])
        n = _SHADOW_TEXELS
        self._heights = context.framebuffer(
            [context.renderbuffer((n, n), 1, dtype="f4")], context.depth_renderbuffer((n, n))
        )
        self._shadow = context.texture((n, n), 1, dtype="f1")
        self._shadow.repeat_x = self._shadow.repeat_y = False
        self._shadow_of: tuple[object, ...] | None = None
        self._backdrop = context.vertex_array(self._programs.backdrop, [])
        self._plane = context.vertex_array(self._programs.plane, [])
        self._shade = context.vertex_array(self._programs.shade, [])
        self._compose = context.vertex_array(self._programs.compose, [])
        self._line_buffer = context.buffer(reserve=24)
        self._line = context.vertex_array(self._programs.edge, [(self._line_buffer, "3f", "position")])
        self._backdrops: dict[tuple[object, ...], moderngl.Framebuffer] = {}
        self._meshes: dict[str, Uploaded] = {}
        self._picture = np.empty((size[1], size[0], 3), dtype=np.uint8)

    def has(self, name: str) -> bool:
        """Whether it was given that mesh."""
        return name in self._meshes

    def add(self, name: str, mesh: Mesh) -> None:
        """Take a mesh; one of that name before is forgotten."""
        self.forget([name])
        with self.context:
            self._meshes[name] = upload(self.context, self._programs, mesh)
        self._shadow_of = None

    def forget(self, names: Iterable[str]) -> None:
        """Let meshes go."""
        with self.context:
            for name in names:
                uploaded = self._meshes.pop(name, None)
                if uploaded is not None:
                    uploaded.release()

    def draw(self, scene: Scene, camera: Camera) -> Picture:
        """A picture of the scene: (height, width, 3) uint8 RGB, valid until the next is drawn."""
        # Another drawing's context may be the thread's current one.
        with self.context:
            return self._draw(scene, camera)

    def corners(self, scene: Scene) -> FloatArray | None:
        """(n, 3) corners of boxes around the bodies, in the site's frame [m]; None: there are none."""
        return _corners(
            [(part, self._meshes[part.mesh]) for part in scene.parts if part.mesh in self._meshes]
        )

    def close(self) -> None:
        """Release everything; the context too."""
        self.forget(list(self._meshes))
        self.context.release()

    def _draw(self, scene: Scene, camera: Camera) -> Picture:
        aspect = self.size[0] / self.size[1]
        matrix = site_to_clip(camera, aspect, center=scene.center, radius=4.0 * scene.radius)
        self.context.copy_framebuffer(self._final, self._backdrop_of(scene, camera, matrix))
        if abs(camera.forward[2]) > _EDGE_ON or not camera.orthographic:
            self._cast_shadow(scene)
            self._lay_shadow(scene, matrix)
        parts = self._known(scene)
        rectangle = _rectangle(parts, matrix, self.size)
        if rectangle is not None:
            self._draw_bodies(parts, scene, camera, matrix, rectangle)
            self._lay_bodies(rectangle, opacity=1.0 - (1.0 - _STALE_OPACITY) * scene.stale)
        self._final.read_into(self._picture, components=3)
        return self._picture

    def _known(self, scene: Scene) -> list[tuple[Part, Uploaded]]:
        return [(part, self._meshes[part.mesh]) for part in scene.parts if part.mesh in self._meshes]

    def _draw_bodies(
        self,
        parts: list[tuple[Part, Uploaded]],
        scene: Scene,
        camera: Camera,
        matrix: FloatArray,
        rectangle: tuple[int, int, int, int],
    ) -> None:
        context, programs = self.context, self._programs
        set_uniforms(
            programs.body,
            site_to_clip=columns(matrix),
            eye=tuple(camera.eye),
            forward=tuple(camera.forward),
            orthographic=float(camera.orthographic),
            stale=scene.stale,
            floor_height=scene.floor,
        )
        set_uniforms(programs.edge, site_to_clip=columns(matrix), tone=_EDGE_TONE)
        self._bodies.use()
        self._bodies.scissor = rectangle
        self._bodies.clear(depth=1.0)
        context.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE | moderngl.BLEND)
        # The layer holds colours times their opacity, and is laid over the rest later.
        context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        # The projection turns the picture over, and with it which way round a face goes.
        context.front_face = "cw"
        # What lets light through comes last, over what stands behind it.
        for part, uploaded in sorted(parts, key=lambda pair: pair[1].transparent):
            placement = columns(part.part_to_site)
            if uploaded.body is not None:
                # Faces a little back, so that the edges drawn over them are whole.
                context.polygon_offset = 1.0, 2.0
                set_uniforms(programs.body, part_to_site=placement)
                uploaded.body.render()
                context.polygon_offset = 0.0, 0.0
            if uploaded.edges is not None:
                set_uniforms(programs.edge, part_to_site=placement)
                uploaded.edges.render()

    def _lay_bodies(self, rectangle: tuple[int, int, int, int], *, opacity: float) -> None:
        x, y, width, height = rectangle
        corners = np.array([x, y, x + width, y + height]) / np.array([*self.size, *self.size]) * 2.0 - 1.0
        self._final.use()
        self.context.enable_only(moderngl.BLEND)
        self.context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        self._bodies_layer.use(0)
        set_uniforms(self._programs.compose, rectangle=tuple(corners), opacity=opacity)
        self._compose.render(moderngl.TRIANGLE_STRIP, vertices=4)

    def _backdrop_of(self, scene: Scene, camera: Camera, matrix: FloatArray) -> moderngl.Framebuffer:
        """Backdrop and grid of a camera, drawn when it is first asked for."""
        key = (matrix.tobytes(), scene.floor)
        backdrop = self._backdrops.get(key)
        if backdrop is None:
            if len(self._backdrops) >= _MOST_BACKDROPS:
                oldest = self._backdrops.pop(next(iter(self._backdrops)))
                oldest.color_attachments[0].release()
                oldest.release()
            backdrop = self.context.framebuffer([self.context.renderbuffer(self.size, 4)])
            self._backdrops[key] = backdrop
            self._draw_backdrop(backdrop, scene, camera, matrix)
        return backdrop

    def _draw_backdrop(
        self, target: moderngl.Framebuffer, scene: Scene, camera: Camera, matrix: FloatArray
    ) -> None:
        """A calm gradient and the floor's grid; seen edge-on, squared paper and the floor's line."""
        forward = camera.forward
        edge_on = camera.orthographic and abs(forward[2]) < _EDGE_ON
        extent = 6.0 * scene.radius
        # Lines stay where they are in the site, wherever the scene's middle is.
        floor = np.array([*np.round(scene.center[:2]), scene.floor])
        up = np.array([0.0, 0.0, 1.0])
        origin, u, v = floor, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
        if edge_on:
            origin, u, v = floor + forward * 3.5 * scene.radius, np.cross(forward, up), up
        target.use()
        self.context.enable_only(moderngl.BLEND)
        self.context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        # Looked at from above, there is no horizon to shade towards.
        set_uniforms(self._programs.backdrop, level=1.0 - abs(float(forward[2])) ** 4)
        self._backdrop.render(vertices=3)
        set_uniforms(
            self._programs.plane,
            site_to_clip=columns(matrix),
            origin=tuple(origin),
            u=tuple(u),
            v=tuple(v),
            extent=extent,
            fine=0.1,
            coarse=0.5,
            strength=0.55 if edge_on else 1.0,
        )
        self._plane.render(moderngl.TRIANGLE_STRIP, vertices=4)
        if edge_on:
            ends = np.array([origin - u * extent, origin + u * extent], dtype=np.float32)
            self._line_buffer.write(ends.tobytes())
            identity = columns(np.eye(4))
            set_uniforms(
                self._programs.edge, site_to_clip=columns(matrix), part_to_site=identity, tone=_LINE_TONE
            )
            self.context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
            self._line.render(moderngl.LINES)

    def _cast_shadow(self, scene: Scene) -> None:
        """Draw the shadow map anew, unless nothing has moved since."""
        placements = tuple((part.mesh, part.part_to_site.tobytes()) for part in scene.parts)
        key = (placements, scene.center.tobytes(), scene.radius, scene.floor)
        if key == self._shadow_of:
            return
        program, extent = self._programs.cast, _shadow_extent(scene)
        self._heights.use()
        self._heights.clear(NOTHING, depth=1.0)
        self.context.enable_only(moderngl.DEPTH_TEST)
        set_uniforms(
            program,
            center=tuple(scene.center[:2]),
            extent=extent,
            floor_height=scene.floor,
            tallest=4.0 * scene.radius,
        )
        for part in scene.parts:
            uploaded = self._meshes.get(part.mesh)
            if uploaded is not None and uploaded.shadow is not None:
                set_uniforms(program, part_to_site=columns(part.part_to_site))
                uploaded.shadow.render()
        n = _SHADOW_TEXELS
        heights = np.frombuffer(self._heights.read(components=1, dtype="f4"), dtype=np.float32).reshape(n, n)
        dark = soft_shadow(heights / scene.radius, texel=2.0 * extent / n / scene.radius)
        self._shadow.write((np.clip(dark, 0.0, 1.0) * 255.0).astype(np.uint8).tobytes())
        self._shadow_of = key

    def _lay_shadow(self, scene: Scene, matrix: FloatArray) -> None:
        self._final.use()
        self.context.enable_only(moderngl.BLEND)
        self.context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._shadow.use(0)
        set_uniforms(
            self._programs.shade,
            site_to_clip=columns(matrix),
            origin=(*scene.center[:2], scene.floor),
            u=(1.0, 0.0, 0.0),
            v=(0.0, 1.0, 0.0),
            extent=_shadow_extent(scene),
            strength=1.0 - 0.5 * scene.stale,
        )
        self._shade.render(moderngl.TRIANGLE_STRIP, vertices=4)


def _shadow_extent(scene: Scene) -> float:
    return 1.5 * scene.radius


def _corners(parts: list[tuple[Part, Uploaded]]) -> FloatArray | None:
    if not parts:
        return None
    return np.concatenate(
        [
            uploaded.corners @ part.part_to_site[:3, :3].T + part.part_to_site[:3, 3]
            for part, uploaded in parts
        ]
    )


def _rectangle(
    parts: list[tuple[Part, Uploaded]], matrix: FloatArray, size: tuple[int, int]
) -> tuple[int, int, int, int] | None:
    """(x, y, width, height) of the picture that the parts can fill [px]; None: nothing of it."""
    corners = _corners(parts)
    if corners is None:
        return None
    clip = np.c_[corners, np.ones(len(corners))] @ matrix.T
    if (clip[:, 3] <= 1e-6).any():
        return 0, 0, *size  # something stands beside or behind the eye
    places = (clip[:, :2] / clip[:, 3:] + 1.0) / 2.0 * np.array(size)
    low = np.clip(np.floor(places.min(axis=0)) - 2, 0, size).astype(int)
    high = np.clip(np.ceil(places.max(axis=0)) + 2, 0, size).astype(int)
    width, height = (high - low).tolist()
    return (int(low[0]), int(low[1]), width, height) if width > 0 and height > 0 else None
