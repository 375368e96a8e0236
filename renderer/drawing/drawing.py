"""Drawing of a scene: backdrop and grid, the floor's shadow, then the bodies.

The static background is drawn once for each camera. Only the bodies need several samples per pixel: they
have a layer, of which only the rectangle that they fill is drawn and resolved. In software OpenGL that
halves the time. Without anti-aliasing the bodies are drawn on the picture itself.
"""

from collections.abc import Iterable, Sequence
from enum import StrEnum
from typing import NamedTuple

import cv2
import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.drawing.backdrop import EDGE_ON, Backdrops
from renderer.drawing.body_shaders import KEY
from renderer.drawing.level_of_detail import LevelsOfDetail
from renderer.drawing.lighting import LampShadow
from renderer.drawing.obstruction import contains, hides
from renderer.drawing.opengl import Uploaded, columns, compile_programs, device_name, set_uniforms, upload
from renderer.drawing.ribbons import ribbons
from renderer.drawing.shadow import FloorShadow
from renderer.scene.cameras import Camera, scales, site_to_clip
from renderer.scene.scene import Finish, Line, Part, Scene
from renderer.shapes.prepare import BufferGeometry
from renderer.shapes.vertex_light import counts_at

Picture = NDArray[np.uint8]
FloatArray = NDArray[np.float64]
Bodies = list[tuple[Part, Uploaded]]

_EDGE_TONE = (0.06, 0.07, 0.09, 0.42)
# Linear red, green, blue, and their share in a body's colour; then its opacity.
_FINISHES: dict[Finish, tuple[tuple[float, float, float, float], float]] = {
    Finish.PLAIN: ((0.0, 0.0, 0.0, 0.0), 1.0),
    Finish.STALE: ((0.0, 0.0, 0.0, 0.0), 1.0),
    Finish.RED: ((0.80, 0.03, 0.02, 0.85), 1.0),
    Finish.GHOST: ((0.05, 0.28, 0.85, 1.0), 0.38),
}
# Opacity of a fixture between the camera and the arm.
_SEEN_THROUGH = 0.16
# Largest radius of the drawn space, over that of the arm's workspace: a distant fence must not use up the
# precision of the depth buffer.
_FARTHEST = 6.0
_MOST_RIBBON_BYTES = 1 << 20
# Height of the floor if there is none: far below, where it reflects no light.
_NO_FLOOR = -1e6
# Polygon offsets (factor, units) of bodies and of ghosts, which are behind bodies at the same place.
_BACK = ((1.0, 2.0), (3.0, 12.0))


class Shading(StrEnum):
    """The quality of shading.

    FAST: a soft shadow on the floor. FULL: the lamp's shadow on robots and fixtures too.
    """

    FAST = "fast"
    FULL = "full"


class _Body(NamedTuple):
    """A body to draw, and its triangles: those from `first` to `middle` are lit at their vertices."""

    part: Part
    uploaded: Uploaded
    first: int
    middle: int
    end: int


class Drawing:
    """A drawing surface of one size with its shapes; used in the context's thread only.

    Attributes:
        renderer_name: The OpenGL driver's name of the device, and whether it draws in software.
    """

    def __init__(
        self,
        context: moderngl.Context,
        size: tuple[int, int],
        *,
        samples: int = 4,
        shading: Shading | str = Shading.FAST,
    ) -> None:
        self.context = context
        self.size = size
        self.renderer_name = device_name(context)
        samples = min(samples, context.max_samples)
        programs = compile_programs(context, samples=samples, full=Shading(shading) is Shading.FULL)
        self._programs = programs
        depths = context.depth_renderbuffer(size, samples=samples)
        # None: the bodies are drawn on the picture itself.
        self._layer = context.texture(size, 4, samples=samples) if samples else None
        self._final = context.framebuffer([context.renderbuffer(size, 4)], None if samples else depths)
        self._bodies = self._final if self._layer is None else context.framebuffer([self._layer], depths)
        self._backdrops = Backdrops(context, programs, size)
        self._shadow = FloorShadow(context, programs)
        self._lamp = LampShadow(context, programs) if Shading(shading) is Shading.FULL else None
        self._compose = context.vertex_array(programs.compose, [])
        self._ribbon_buffer = context.buffer(reserve=_MOST_RIBBON_BYTES, dynamic=True)
        self._ribbon = context.vertex_array(
            programs.ribbon, [(self._ribbon_buffer, "4f 4f", "place", "tone")]
        )
        self._shapes: dict[str, Uploaded] = {}
        self._levels = LevelsOfDetail()
        self._pixels = np.empty((size[1], size[0], 4), dtype=np.uint8)

    def has(self, name: str) -> bool:
        """Return whether the shape was added."""
        return name in self._shapes

    def add(self, name: str, geometry: BufferGeometry) -> None:
        """Add a shape; it replaces one of the same name."""
        self.forget([name])
        with self.context:
            self._shapes[name] = upload(self.context, self._programs, geometry)
        self._shadow.forget()

    def forget(self, names: Iterable[str]) -> None:
        """Release shapes."""
        with self.context:
            for name in names:
                uploaded = self._shapes.pop(name, None)
                if uploaded is not None:
                    uploaded.release()

    def draw(self, scene: Scene, camera: Camera) -> Picture:
        """Return a picture of the scene: (height, width, 3) uint8 RGB."""
        # The thread's current context may be another drawing's.
        with self.context:
            return self._draw(scene, camera)

    def corners(self, scene: Scene) -> FloatArray | None:
        """Return the (n, 3) corners of the boxes around the scene's parts, in the site's frame [m].

        None if there are no parts.
        """
        known = self._known(scene.parts)
        return _corners(known) if known else None

    def inside(self, scene: Scene, camera: Camera) -> str:
        """Return the name of the body that contains a perspective camera's eye, or an empty text."""
        if camera.orthographic:
            return ""
        for part, uploaded in self._known(scene.parts + scene.others + scene.fixtures):
            eye = part.part_to_site[:3, :3].T @ (camera.eye - part.part_to_site[:3, 3])
            box = uploaded.corners
            if part.finish is not Finish.GHOST and (eye >= box[0]).all() and (eye <= box[-1]).all():
                geometry = uploaded.geometry
                if contains(geometry.positions.astype(np.float64), geometry.finest, eye):
                    return part.name
        return ""

    def close(self) -> None:
        """Release all shapes and the context."""
        self.forget(list(self._shapes))
        self.context.release()

    def _draw(self, scene: Scene, camera: Camera) -> Picture:
        aspect = self.size[0] / self.size[1]
        fixtures = self._known(scene.fixtures)
        moving = self._known(scene.parts + scene.others)
        center, radius = _scene_bounds(scene, fixtures)
        matrix = site_to_clip(camera, aspect, center=center, radius=4.0 * radius)
        backdrop = self._backdrops.of(
            camera, matrix, center=scene.center, radius=scene.radius, floor=scene.floor
        )
        self.context.copy_framebuffer(self._final, backdrop)
        solid = [pair for pair in moving + fixtures if pair[0].finish is not Finish.GHOST]
        if scene.floor is not None and (abs(camera.forward[2]) > EDGE_ON or not camera.orthographic):
            self._shadow.cast(solid, center=center, radius=radius, floor=scene.floor)
            self._final.use()
            self._shadow.lay(matrix, center=center, radius=radius, floor=scene.floor)
        rectangle = _rectangle(moving + fixtures, scene.lines, matrix, self.size)
        if rectangle is not None:
            if self._lamp is not None:
                self._lamp.light(solid, center=center, radius=radius)
            through = {
                pair[0].shape
                for pair in fixtures
                if hides(camera, aspect, _corners([pair]), center=scene.center, radius=scene.radius)
            }
            self._draw_bodies(moving + fixtures, scene, camera, matrix, rectangle, through)
            if self._layer is not None:
                self._lay_bodies(self._layer, rectangle)
        # Mesa converts to three channels slowly: 1.8 ms for 1280 x 720, 0.3 ms this way.
        self._final.read_into(self._pixels, components=4)
        picture = np.empty((*self._pixels.shape[:2], 3), dtype=np.uint8)
        cv2.cvtColor(self._pixels, cv2.COLOR_RGBA2RGB, dst=picture)
        return picture

    def _known(self, parts: tuple[Part, ...]) -> Bodies:
        return [(part, self._shapes[part.shape]) for part in parts if part.shape in self._shapes]

    def _draw_bodies(
        self,
        bodies: Bodies,
        scene: Scene,
        camera: Camera,
        matrix: FloatArray,
        rectangle: tuple[int, int, int, int],
        through: set[str],
    ) -> None:
        context, programs = self.context, self._programs
        key = np.array(KEY) / np.linalg.norm(KEY)
        for program in (programs.body, programs.vertex_lit):
            set_uniforms(
                program,
                site_to_clip=columns(matrix),
                eye=tuple(camera.eye),
                forward=tuple(camera.forward),
                orthographic=float(camera.orthographic),
                floor_height=_NO_FLOOR if scene.floor is None else scene.floor,
                per_near_floor=1.0 / (0.18 * scene.radius),
                key=tuple(key),
            )
        set_uniforms(programs.edge, site_to_clip=columns(matrix))
        self._bodies.scissor = rectangle
        # The picture keeps its colours, a layer begins transparent.
        self._bodies.color_mask = (self._layer is not None,) * 4
        self._bodies.clear(depth=1.0)
        self._bodies.color_mask = (True,) * 4
        self._bodies.use()  # after `clear`, only this sets the mask
        context.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE | moderngl.BLEND)
        # Colours are premultiplied: a layer is blended over the rest later.
        context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        # The projection flips the picture, and with it the winding of faces.
        context.front_face = "cw"
        solid, glass, ghosts = [], [], []
        for body in self._by_distance(bodies, camera):
            if body.part.finish is Finish.GHOST:
                ghosts.append(body)
            elif body.uploaded.geometry.transparent or body.part.shape in through:
                glass.append(body)
            else:
                solid.append(body)
        # The nearest first and without blending, so that hidden faces cost least.
        context.disable(moderngl.BLEND)
        for body in solid:
            self._draw_faces(body)
        context.enable(moderngl.BLEND)
        for body in solid:
            self._draw_edges(body)
        self._draw_lines(scene.lines, matrix)
        # Transparent bodies last, the farthest first; then the ghost over everything.
        for body in reversed(glass):
            self._draw_faces(body, opacity=_SEEN_THROUGH if body.part.shape in through else 1.0)
            self._draw_edges(body)
        # Only a ghost's nearest faces: draw depth first, then the faces with that depth.
        self._bodies.color_mask = (False,) * 4
        for body in ghosts:
            self._draw_faces(body)
        self._bodies.color_mask = (True,) * 4
        context.depth_func = "<="
        for body in ghosts:
            self._draw_faces(body)
            self._draw_edges(body)
        context.depth_func = "<"
        self._bodies.scissor = 0, 0, *self.size

    def _by_distance(self, bodies: Bodies, camera: Camera) -> list[_Body]:
        """Return the bodies, the nearest first."""
        if not bodies:
            return []
        distances = (_corners(bodies).reshape(-1, 8, 3) - camera.eye) @ camera.forward
        scale = scales(camera, self.size[1], distances.min(axis=1))
        levels = self._levels.of(bodies, camera, scale)
        counts = np.array(
            [uploaded.geometry.vertex_lit[level] for (_, uploaded), level in zip(bodies, levels, strict=True)]
        )
        if self._lamp is not None:
            counts[:] = 0  # shadows on bodies have edges within triangles
        lit = counts_at(scale, counts).tolist()
        found = []
        for number in np.argsort(distances.mean(axis=1), kind="stable").tolist():
            part, uploaded = bodies[number]
            first, end = uploaded.levels[levels[number]]
            found.append(_Body(part, uploaded, first, first + lit[number], end))
        return found

    def _draw_faces(self, body: _Body, *, opacity: float = 1.0) -> None:
        part, uploaded, first, middle, end = body
        tint, own_opacity = _FINISHES[part.finish]
        # Slightly farther away, so that the edges drawn on the faces are not hidden.
        self.context.polygon_offset = _BACK[part.finish is Finish.GHOST]
        draws = (
            (self._programs.vertex_lit, uploaded.vertex_lit, first, middle),
            (self._programs.body, uploaded.body, middle, end),
        )
        for program, array, begin, stop in draws:
            if array is not None and begin < stop:
                set_uniforms(
                    program,
                    part_to_site=columns(part.part_to_site),
                    tint=tint,
                    opacity=opacity * own_opacity,
                    stale=float(part.finish is Finish.STALE),
                )
                array.render(first=3 * begin, vertices=3 * (stop - begin))
        self.context.polygon_offset = 0.0, 0.0

    def _draw_edges(self, body: _Body) -> None:
        part, uploaded = body.part, body.uploaded
        if uploaded.edges is not None:
            red, green, blue, share = _EDGE_TONE
            tone = red, green, blue, share * _FINISHES[part.finish][1]
            set_uniforms(self._programs.edge, part_to_site=columns(part.part_to_site), tone=tone)
            uploaded.edges.render()

    def _draw_lines(self, lines: Sequence[Line], matrix: FloatArray) -> None:
        if not lines:
            return
        corners = ribbons(lines, matrix, self.size)
        most = _MOST_RIBBON_BYTES // corners[:1].nbytes if len(corners) else 0
        corners = corners[-most:] if most else corners
        if len(corners):
            self._ribbon_buffer.write(corners.tobytes())
            self.context.disable(moderngl.CULL_FACE)
            self._ribbon.render(vertices=len(corners))
            self.context.enable(moderngl.CULL_FACE)

    def _lay_bodies(self, layer: moderngl.Texture, rectangle: tuple[int, int, int, int]) -> None:
        x, y, width, height = rectangle
        corners = np.array([x, y, x + width, y + height]) / np.array([*self.size, *self.size]) * 2.0 - 1.0
        self._final.use()
        self.context.enable_only(moderngl.BLEND)
        self.context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        layer.use(0)
        set_uniforms(self._programs.compose, rectangle=tuple(corners))
        self._compose.render(moderngl.TRIANGLE_STRIP, vertices=4)


def _scene_bounds(scene: Scene, fixtures: Bodies) -> tuple[FloatArray, float]:
    """Return centre and radius of the space that the shadow and the depth range must include.

    It contains the arm's workspace and the fixtures, unless they are too far away.
    """
    if not fixtures:
        return scene.center, scene.radius
    corners = _corners(fixtures)
    low = np.minimum(corners.min(axis=0), scene.center - scene.radius)
    high = np.maximum(corners.max(axis=0), scene.center + scene.radius)
    radius = float(np.linalg.norm(high - low)) / 2.0
    if radius > _FARTHEST * scene.radius:
        return scene.center, _FARTHEST * scene.radius
    return (low + high) / 2.0, radius


def _corners(bodies: Bodies) -> FloatArray:
    """Return the (8n, 3) corners of the boxes around bodies, in the site's frame [m]."""
    if not bodies:
        return np.empty((0, 3))
    boxes = np.array([uploaded.corners for _, uploaded in bodies])
    placements = np.array([part.part_to_site for part, _ in bodies])
    corners: FloatArray = boxes @ placements[:, :3, :3].swapaxes(1, 2) + placements[:, None, :3, 3]
    return corners.reshape(-1, 3)


def _rectangle(
    bodies: Bodies, lines: Sequence[Line], matrix: FloatArray, size: tuple[int, int]
) -> tuple[int, int, int, int] | None:
    """Return the rectangle (x, y, width, height) that bodies and lines can fill [px]; None if it is empty."""
    points = np.concatenate([_corners(bodies), *(line.points for line in lines)])
    if not len(points):
        return None
    clip = np.c_[points, np.ones(len(points))] @ matrix.T
    if (clip[:, 3] <= 1e-6).any():
        return 0, 0, *size  # a point is next to the eye or behind it
    places = (clip[:, :2] / clip[:, 3:] + 1.0) / 2.0 * np.array(size)
    edge = 2 + (size[1] // 180 if lines else 0)
    low = np.clip(np.floor(places.min(axis=0)) - edge, 0, size).astype(int)
    high = np.clip(np.ceil(places.max(axis=0)) + edge, 0, size).astype(int)
    width, height = (high - low).tolist()
    return (int(low[0]), int(low[1]), width, height) if width > 0 and height > 0 else None
