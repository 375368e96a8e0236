"""Drawing a scene with OpenGL, off screen.

A context belongs to the thread that made it: make, use and close a `Drawing` in one thread.
"""

import ctypes
from collections.abc import Iterable
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer import shaders
from renderer.cameras import Camera, site_to_clip
from renderer.errors import NoOpenGLError
from renderer.mesh import Mesh
from renderer.scene import Part, Scene
from renderer.shadow import NOTHING, soft_shadow

Picture = NDArray[np.uint8]

_SHADOW_TEXELS = 160
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_EDGE_TONE = (0.07, 0.08, 0.10, 0.42)
_LINE_TONE = (0.30, 0.34, 0.39, 0.9)


def open_context(device: int | None = None) -> moderngl.Context:
    """An OpenGL context without a screen, through EGL.

    Args:
        device: Number of the EGL device, on a machine with several GPUs; None: EGL's own choice.

    Raises:
        NoOpenGLError: If there is no EGL or OpenGL library, or no such device.
    """
    _keep_freed_memory()
    options: dict[str, Any] = {"standalone": True, "backend": "egl", "require": 330}
    if device is not None:
        options["device_index"] = device
    try:
        return moderngl.create_context(**options)
    except Exception as error:  # moderngl raises bare Exception, ImportError and OSError here.
        raise NoOpenGLError(" ".join(str(error).split()) or type(error).__name__) from None


def _keep_freed_memory() -> None:
    """Software OpenGL frees its scene each frame; glibc must not give it back (16.7 -> 11.4 ms)."""
    try:
        libc = ctypes.CDLL(None)
        libc.mallopt(_M_MMAP_THRESHOLD, 32 << 20)
        libc.mallopt(_M_TRIM_THRESHOLD, 2_000_000_000)
    except (OSError, AttributeError):
        return  # another C library, which has no such habit


class _Uploaded:
    """A mesh on the GPU."""

    def __init__(self, drawing: "Drawing", mesh: Mesh) -> None:
        context = drawing.context
        vertices = np.zeros(
            len(mesh.positions), dtype=[("p", "f4", 3), ("n", "f4", 3), ("c", "u1", 4), ("s", "u1", 4)]
        )
        vertices["p"], vertices["n"] = mesh.positions, mesh.normals
        vertices["c"], vertices["s"] = mesh.colors, mesh.surface
        self.transparent = mesh.transparent
        self._buffers = []
        self.body = self.edges = self.shadow = None
        if len(vertices):
            self._buffers.append(context.buffer(vertices.tobytes()))
            layout = (self._buffers[-1], "3f 3f 4f1 4f1", "position", "normal", "paint", "surface")
            self.body = context.vertex_array(drawing.body_program, [layout])
        if len(mesh.edges):
            self._buffers.append(context.buffer(mesh.edges.tobytes()))
            self.edges = context.vertex_array(
                drawing.edge_program, [(self._buffers[-1], "3f", "position")], mode=moderngl.LINES
            )
        if len(mesh.shadow):
            self._buffers.append(context.buffer(mesh.shadow.tobytes()))
            self.shadow = context.vertex_array(
                drawing.shadow_program, [(self._buffers[-1], "3f", "position")]
            )

    def release(self) -> None:
        for array in (self.body, self.edges, self.shadow):
            if array is not None:
                array.release()
        for buffer in self._buffers:
            buffer.release()


class Drawing:
    """Draws scenes of the meshes that it was given, at one size."""

    def __init__(self, context: moderngl.Context, size: tuple[int, int], *, samples: int = 4) -> None:
        self.context = context
        self.size = size
        samples = min(samples, context.max_samples)
        self._multi = context.framebuffer(
            [context.renderbuffer(size, 4, samples=samples)],
            context.depth_renderbuffer(size, samples=samples),
        )
        self._plain = context.framebuffer([context.renderbuffer(size, 4)]) if samples else self._multi
        self.body_program = context.program(shaders.BODY_VERTEX, shaders.BODY_FRAGMENT)
        self.edge_program = context.program(shaders.EDGE_VERTEX, shaders.EDGE_FRAGMENT)
        self.shadow_program = context.program(shaders.SHADOW_VERTEX, shaders.SHADOW_FRAGMENT)
        self._plane_program = context.program(shaders.PLANE_VERTEX, shaders.PLANE_FRAGMENT)
        self._backdrop_program = context.program(shaders.FULL_PICTURE_VERTEX, shaders.BACKDROP_FRAGMENT)
        self._backdrop = context.vertex_array(self._backdrop_program, [])
        self._plane = context.vertex_array(self._plane_program, [])
        self._line_buffer = context.buffer(reserve=24)
        self._line = context.vertex_array(self.edge_program, [(self._line_buffer, "3f", "position")])
        n = _SHADOW_TEXELS
        self._heights = context.framebuffer(
            [context.renderbuffer((n, n), 1, dtype="f4")], context.depth_renderbuffer((n, n))
        )
        self._shadow = context.texture((n, n), 1, dtype="f1")
        self._shadow.repeat_x = self._shadow.repeat_y = False
        self._shadow_of: tuple[object, ...] | None = None
        self._meshes: dict[str, _Uploaded] = {}
        self._picture = np.empty((size[1], size[0], 3), dtype=np.uint8)

    @property
    def renderer_name(self) -> str:
        """What draws, in the driver's words."""
        return str(self.context.info["GL_RENDERER"])

    def has(self, name: str) -> bool:
        """Whether it was given that mesh."""
        return name in self._meshes

    def add(self, name: str, mesh: Mesh) -> None:
        """Take a mesh; one of that name before is forgotten."""
        self.forget([name])
        self._meshes[name] = _Uploaded(self, mesh)

    def forget(self, names: Iterable[str]) -> None:
        """Let meshes go."""
        for name in names:
            uploaded = self._meshes.pop(name, None)
            if uploaded is not None:
                uploaded.release()

    def draw(self, scene: Scene, camera: Camera) -> Picture:
        """A picture of the scene: (height, width, 3) uint8 RGB, valid until the next is drawn."""
        context = self.context
        aspect = self.size[0] / self.size[1]
        matrix = site_to_clip(camera, aspect, center=scene.center, radius=4.0 * scene.radius)
        self._cast_shadow(scene)
        self._multi.use()
        self._multi.clear(depth=1.0)
        context.disable(moderngl.CULL_FACE | moderngl.BLEND)
        context.disable(moderngl.DEPTH_TEST)
        # Looked at from above, there is no horizon to shade towards.
        _set(self._backdrop_program, level=1.0 - abs(float(camera.forward[2])) ** 4)
        self._backdrop.render(vertices=3)
        context.enable(moderngl.DEPTH_TEST | moderngl.BLEND)
        context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._draw_plane(scene, camera, matrix)
        self._draw_bodies(scene, camera, matrix)
        if self._plain is not self._multi:
            context.copy_framebuffer(self._plain, self._multi)
        self._plain.read_into(self._picture, components=3)
        return self._picture

    def close(self) -> None:
        """Release everything; the context too."""
        self.forget(list(self._meshes))
        self.context.release()

    def _uploaded(self, part: Part) -> _Uploaded | None:
        return self._meshes.get(part.mesh)

    def _draw_bodies(self, scene: Scene, camera: Camera, matrix: NDArray[np.float64]) -> None:
        context = self.context
        _set(
            self.body_program,
            site_to_clip=_columns(matrix),
            eye=tuple(camera.eye),
            forward=tuple(camera.forward),
            orthographic=float(camera.orthographic),
            stale=scene.stale,
            floor_height=scene.floor,
        )
        tone = (*_EDGE_TONE[:3], _EDGE_TONE[3] * (1.0 - 0.5 * scene.stale))
        _set(self.edge_program, site_to_clip=_columns(matrix), tone=tone)
        # The projection turns the picture over, and with it which way round a face goes.
        context.front_face = "cw"
        context.enable(moderngl.CULL_FACE)
        # What lets light through comes last, over what stands behind it.
        for part in sorted(scene.parts, key=lambda part: self._is_transparent(part)):
            uploaded = self._uploaded(part)
            if uploaded is None:
                continue
            placement = _columns(part.part_to_site)
            if uploaded.body is not None:
                # Faces a little back, so that the edges drawn over them are whole.
                context.polygon_offset = 1.0, 2.0
                _set(self.body_program, part_to_site=placement)
                uploaded.body.render()
                context.polygon_offset = 0.0, 0.0
            if uploaded.edges is not None:
                _set(self.edge_program, part_to_site=placement)
                uploaded.edges.render()

    def _is_transparent(self, part: Part) -> bool:
        uploaded = self._uploaded(part)
        return uploaded is not None and uploaded.transparent

    def _draw_plane(self, scene: Scene, camera: Camera, matrix: NDArray[np.float64]) -> None:
        """The floor; where it is seen edge-on, a squared paper behind the robot and the floor's line."""
        forward = camera.forward
        edge_on = camera.orthographic and abs(forward[2]) < 0.05
        extent = 6.0 * scene.radius
        floor = np.array([scene.center[0], scene.center[1], scene.floor])
        # Lines stay where they are in the site, wherever the scene's middle is.
        floor[:2] = np.round(floor[:2])
        if edge_on:
            right = np.cross(forward, [0.0, 0.0, 1.0])
            origin, u, v = floor + forward * 3.5 * scene.radius, right, np.array([0.0, 0.0, 1.0])
        else:
            origin, u, v = floor, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
        _set(
            self._plane_program,
            site_to_clip=_columns(matrix),
            origin=tuple(origin),
            u=tuple(u),
            v=tuple(v),
            extent=extent,
            fine=0.1,
            coarse=0.5,
            strength=0.55 if edge_on else 1.0,
            shade=0.0 if edge_on else 1.0 - 0.5 * scene.stale,
            shadow_center=tuple(scene.center[:2] - floor[:2]),
            shadow_extent=_shadow_extent(scene),
        )
        self._shadow.use(0)
        self._multi.depth_mask = False
        self._plane.render(moderngl.TRIANGLE_STRIP, vertices=4)
        if edge_on:
            identity = _columns(np.eye(4))
            _set(self.edge_program, site_to_clip=_columns(matrix), part_to_site=identity, tone=_LINE_TONE)
            behind = floor + forward * 3.0 * scene.radius
            self._line_buffer.write(
                np.array([behind - u * extent, behind + u * extent], dtype=np.float32).tobytes()
            )
            self._line.render(moderngl.LINES)
        self._multi.depth_mask = True

    def _cast_shadow(self, scene: Scene) -> None:
        """Draw the shadow map anew, unless nothing has moved since."""
        placements = tuple((part.mesh, part.part_to_site.tobytes()) for part in scene.parts)
        key = (placements, scene.center.tobytes(), scene.radius, scene.floor)
        if key == self._shadow_of:
            return
        context, program, extent = self.context, self.shadow_program, _shadow_extent(scene)
        self._heights.use()
        self._heights.clear(NOTHING, depth=1.0)
        context.enable_only(moderngl.DEPTH_TEST)
        _set(
            program,
            center=tuple(scene.center[:2]),
            extent=extent,
            floor_height=scene.floor,
            tallest=4.0 * scene.radius,
        )
        for part in scene.parts:
            uploaded = self._uploaded(part)
            if uploaded is not None and uploaded.shadow is not None:
                _set(program, part_to_site=_columns(part.part_to_site))
                uploaded.shadow.render()
        n = _SHADOW_TEXELS
        heights = np.frombuffer(self._heights.read(components=1, dtype="f4"), dtype=np.float32).reshape(n, n)
        dark = soft_shadow(heights / scene.radius, texel=2.0 * extent / n / scene.radius)
        self._shadow.write((np.clip(dark, 0.0, 1.0) * 255.0).astype(np.uint8).tobytes())
        self._shadow_of = key


def _shadow_extent(scene: Scene) -> float:
    return 1.5 * scene.radius


def _columns(matrix: NDArray[np.float64]) -> bytes:
    """A matrix as OpenGL takes it: float32, by columns."""
    return np.ascontiguousarray(matrix.T, dtype=np.float32).tobytes()


def _set(program: moderngl.Program, **values: bytes | float | tuple[float, ...]) -> None:
    """Give a program its uniforms; those that its compiler found no use for are left out."""
    for name, value in values.items():
        uniform = program.get(name, None)
        if isinstance(uniform, moderngl.Uniform):
            if isinstance(value, bytes):
                uniform.write(value)
            else:
                uniform.value = value
