"""Preparation of a link's shape for drawing: fewer triangles, smooth curved surfaces, sharp edges."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import fast_simplification
import numpy as np
from numpy.typing import NDArray

from renderer.errors import GlbError
from renderer.shapes.creases import FloatArray, IntArray, corner_normals, sharp_edges, weld
from renderer.shapes.occlusion import open_sky
from renderer.shapes.simplification import simplified
from renderer.shapes.vertex_light import SCALES, ordered
from robots.schema.errors import ShapeError
from robots.shapes.files.gltf import TRIANGLES, Surface, read_glb

# Of the finest level: more take memory and time to prepare, and are seen only from very near.
MOST_TRIANGLES = 16_000
# Shapes with more, such as scans, are first reduced to as many without a bound of the error: a simplification
# with a bound of 400,000 rough triangles takes 15 s.
_MOST_BOUNDED = 64_000
# Of a rough scan each side is sharp: the longest remain.
_MOST_EDGES = 8_000
# Errors of levels of detail [m], and the share of triangles from which a level is worth its memory.
_ERRORS_M = tuple(0.0005 * 2.0**step for step in range(6))
_WORTHWHILE = 0.75
# Bodies with fewer triangles are in all levels as they are.
_LEAST = 32
_SHADOW_TRIANGLES = 300
# How fast the simplifier's steps grow (its default: 7).
_GENTLE = 3.0
_PLAIN_COLOR = (0.62, 0.64, 0.66, 1.0)


# A vertex in the layout of the OpenGL buffer.
VERTEX = np.dtype([("position", "f4", 3), ("normal", "f4", 3), ("color", "u1", 4), ("surface", "u1", 4)])


@dataclass(frozen=True, eq=False)
class BufferGeometry:
    """Triangles in the link's frame [m], as arrays for the GPU (as three.js' BufferGeometry).

    Attributes:
        positions: (v, 3) float32.
        normals: (v, 3) float32, unit.
        colors: (v, 4) uint8, sRGB and opacity.
        surface: (v, 4) uint8: the share of the sky that the vertex sees past its own link,
            roughness, metalness, unused.
        triangles: (t, 3) uint32, vertex numbers, of all levels of detail, the finest first.
        levels: (k + 1,) the first triangle of each level, and the number of all.
        errors: (k,) of each level [m]; 0 for the finest.
        vertex_lit: (k, s) number of the first triangles of each level that are lit at their vertices, for
            each of `renderer.shapes.vertex_light.SCALES`.
        edges: (2e, 3) float32, ends of the sharp edges.
        shadow: (3s, 3) float32, a coarse copy that casts the shadow.
    """

    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    colors: NDArray[np.uint8]
    surface: NDArray[np.uint8]
    triangles: NDArray[np.uint32]
    levels: NDArray[np.uint32]
    errors: FloatArray
    vertex_lit: NDArray[np.uint32]
    edges: NDArray[np.float32]
    shadow: NDArray[np.float32]

    @property
    def finest(self) -> NDArray[np.uint32]:
        """(t, 3) triangles of the finest level."""
        return self.triangles[: self.levels[1]]

    @property
    def transparent(self) -> bool:
        """True if any vertex is transparent."""
        return bool((self.colors[:, 3] < 255).any())


def prepared(glb: bytes, *, color: str = "", most_triangles: int = MOST_TRIANGLES) -> BufferGeometry:
    """Return a shape prepared from GLB.

    Args:
        color: "#rrggbb" for surfaces without a colour in the file.
        most_triangles: A shape with more triangles is simplified to at most this number, if an error of
            16 mm is enough for it.

    Raises:
        GlbError: If it is not GLB.
    """
    try:
        surfaces = read_glb(glb)
    except ShapeError as error:
        raise GlbError(str(error)) from None
    return prepared_surfaces(surfaces, color=color, most_triangles=most_triangles)


def prepared_surfaces(
    given: Sequence[Surface], *, color: str = "", most_triangles: int = MOST_TRIANGLES
) -> BufferGeometry:
    """Return a shape prepared from the surfaces of a GLB file; arguments as for `prepared`."""
    surfaces = [surface for surface in given if surface.mode == TRIANGLES and len(surface.indices)]
    plain = srgb(color) if color else _PLAIN_COLOR
    kept = _MOST_BOUNDED / max(sum(len(surface.indices) for surface in surfaces), 1)
    error, bodies = _limited([_Body.of(surface, plain, kept) for surface in surfaces], most_triangles)
    corners = _joined([body.corners() for body in bodies], 3)
    vertices, numbers = _unique(_vertices(bodies))
    points, normals = (vertices[name].astype(np.float64) for name in ("position", "normal"))
    sky = open_sky(points, normals, numbers.reshape(-1, 3))
    by_body = np.split(sky[numbers], np.cumsum([3 * len(body.triangles) for body in bodies], dtype=np.int64))
    bodies = [replace(body, sky=own.reshape(-1, 3)) for body, own in zip(bodies, by_body[:-1], strict=True)]
    levels = [_level(*each) for each in _levels(bodies, error)]
    first_vertex = np.cumsum([0, *(len(level.vertices) for level in levels)])
    joined = np.concatenate([level.vertices for level in levels])
    return BufferGeometry(
        positions=joined["position"],
        normals=joined["normal"],
        colors=joined["color"],
        surface=joined["surface"],
        triangles=np.concatenate(
            [level.triangles + np.uint32(first) for level, first in zip(levels, first_vertex, strict=False)]
        ),
        levels=np.cumsum([0, *(len(level.triangles) for level in levels)]).astype(np.uint32),
        errors=np.array([level.error for level in levels]),
        vertex_lit=np.array([level.vertex_lit for level in levels]),
        edges=_longest(_joined([body.edges.reshape(-1, 3) for body in bodies], 3)).astype(np.float32),
        shadow=_coarse(corners).astype(np.float32),
    )


def srgb(color: str) -> tuple[float, float, float, float]:
    """Return red, green, blue, opacity of "#rrggbb", 0 to 1."""
    red, green, blue = (int(color[at : at + 2], 16) / 255.0 for at in (1, 3, 5))
    return red, green, blue, 1.0


@dataclass(frozen=True, eq=False)
class _Body:
    """Triangles of one material: welded positions, and normals (t, 3, 3) and colours (t, 3, 4) by corner."""

    positions: FloatArray
    triangles: IntArray
    normals: FloatArray
    colors: FloatArray
    edges: FloatArray
    sky: FloatArray
    roughness: float
    metallic: float

    @classmethod
    def of(cls, surface: Surface, plain: tuple[float, float, float, float], kept: float) -> "_Body":
        positions, triangles = _simplified(*weld(surface.vertices, surface.indices), kept)
        color = np.array(surface.color or plain)
        colors = np.tile(color, (len(triangles), 3, 1))
        untouched = len(triangles) == len(surface.indices)
        if untouched and surface.colors is not None:
            colors = surface.colors[surface.indices] * (color if surface.color else 1.0)
        elif surface.colors is not None:
            # Without triangles that have no area, corners are not known: the mean is better than white.
            colors = colors * surface.colors.mean(axis=0)
        if untouched and surface.normals is not None:
            normals = surface.normals[surface.indices]
        else:
            normals = corner_normals(positions, triangles)
        return cls(
            positions=positions,
            triangles=triangles,
            normals=normals,
            colors=colors,
            edges=sharp_edges(positions, triangles),
            sky=np.ones((len(triangles), 3)),
            roughness=surface.roughness,
            metallic=surface.metallic,
        )

    def corners(self) -> FloatArray:
        return self.positions[self.triangles].reshape(-1, 3)

    def surface(self) -> FloatArray:
        others = np.tile((self.roughness, self.metallic, 0.0), (3 * len(self.triangles), 1))
        return np.concatenate([self.sky.reshape(-1, 1), others], axis=1)

    @property
    def plain(self) -> bool:
        """True if all its triangles have one colour."""
        return bool((np.abs(self.colors - self.colors[:1, :1]) < 1e-3).all())

    def simpler(self, error: float) -> "_Body":
        """Return the body with fewer triangles, within an error [m]."""
        if len(self.triangles) < _LEAST:
            return self
        values = np.concatenate([self.normals, self.sky[..., None], self.colors], axis=2)
        positions, triangles, values = simplified(self.positions, self.triangles, values, error=error)
        return replace(
            self,
            positions=positions,
            triangles=triangles,
            normals=values[..., :3],
            sky=values[..., 3],
            colors=values[..., 4:],
        )


@dataclass(frozen=True, eq=False)
class _Level:
    """A level of detail: distinct vertices, the triangles between them, `BufferGeometry.vertex_lit`."""

    error: float
    vertices: NDArray[np.void]
    triangles: NDArray[np.uint32]
    vertex_lit: NDArray[np.uint32]


def _limited(bodies: list[_Body], most_triangles: int) -> tuple[float, list[_Body]]:
    """Return the error [m] with which bodies have at most a number of triangles, and these bodies."""
    done = 0.0
    for error in _ERRORS_M:
        if _count(bodies) <= most_triangles:
            break
        bodies, done = [body.simpler(error - done) for body in bodies], error
    return done, bodies


def _levels(bodies: list[_Body], done: float) -> Iterator[tuple[float, list[_Body]]]:
    """Yield the error [m] of each level of detail and its bodies, the finest first."""
    yield done, bodies
    for error in _ERRORS_M:
        if error > done:
            # Each level is made from the one before, so their errors add up. A flat face may have a pattern.
            fewer = [body.simpler(error - done) if body.plain else body for body in bodies]
            if _count(fewer) < _WORTHWHILE * _count(bodies):
                done, bodies = error, fewer
                yield error, bodies


def _count(bodies: Sequence[_Body]) -> int:
    return sum(len(body.triangles) for body in bodies)


def _level(error: float, bodies: Sequence[_Body]) -> _Level:
    # Merged vertices are shaded once, which saves a third of the time in software OpenGL.
    vertices, numbers = _unique(_vertices(bodies))
    triangles, vertex_lit = numbers.reshape(-1, 3), np.zeros(len(SCALES), dtype=np.uint32)
    if (vertices["color"][:, 3] == 255).all():  # the order of transparent triangles is visible
        points, normals = (vertices[name].astype(np.float64) for name in ("position", "normal"))
        triangles, vertex_lit = ordered(points, normals, vertices["surface"][:, 1] / 255.0, triangles)
    return _Level(error, vertices, triangles, vertex_lit)


def _vertices(bodies: Sequence[_Body]) -> NDArray[np.void]:
    """Return the (3t,) corners of all triangles."""
    corners = _joined([body.corners() for body in bodies], 3)
    vertices = np.zeros(len(corners), dtype=VERTEX)
    vertices["position"] = corners
    vertices["normal"] = np.round(_joined([body.normals.reshape(-1, 3) for body in bodies], 3), 4)
    vertices["color"] = _bytes(_joined([body.colors.reshape(-1, 4) for body in bodies], 4))
    vertices["surface"] = _bytes(_joined([body.surface() for body in bodies], 4))
    return vertices


def _simplified(positions: FloatArray, triangles: IntArray, kept: float) -> tuple[FloatArray, IntArray]:
    if len(triangles) < 32 or kept >= 1.0:
        return positions, triangles
    # The simplifier's steps are absolute: in metres, the first step would already flatten a round cap.
    size = float(np.ptp(positions, axis=0).max())
    points, faces = fast_simplification.simplify(
        (positions / size).astype(np.float32),
        triangles.astype(np.int32),
        target_reduction=1.0 - kept,
        agg=_GENTLE,
    )
    return weld(points.astype(np.float64) * size, faces.astype(np.int64))


def _longest(ends: FloatArray) -> FloatArray:
    """Return the ends (2e, 3) of at most `_MOST_EDGES` edges."""
    lengths = np.linalg.norm(ends[1::2] - ends[::2], axis=1)
    if len(lengths) <= _MOST_EDGES:
        return ends
    longest = np.sort(np.argpartition(-lengths, _MOST_EDGES)[:_MOST_EDGES])
    found: FloatArray = ends.reshape(-1, 2, 3)[longest].reshape(-1, 3)
    return found


def _coarse(corners: FloatArray) -> FloatArray:
    triangles = np.arange(len(corners), dtype=np.int64).reshape(-1, 3)
    positions, triangles = weld(corners, triangles)
    kept = _SHADOW_TRIANGLES / max(len(triangles), 1)
    positions, triangles = _simplified(positions, triangles, kept)
    return positions[triangles].reshape(-1, 3)


def _unique(vertices: NDArray[np.void]) -> tuple[NDArray[np.void], NDArray[np.uint32]]:
    """Return the distinct vertices in the order of first use, and each vertex's number among them."""
    rows = vertices.view(f"V{VERTEX.itemsize}")
    _, first, numbers = np.unique(rows, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return vertices[first[order]], rank[numbers].astype(np.uint32)


def _joined(arrays: Sequence[FloatArray], width: int) -> FloatArray:
    return np.concatenate([np.empty((0, width)), *arrays])


def _bytes(values: FloatArray) -> NDArray[np.uint8]:
    return np.round(np.clip(values, 0.0, 1.0) * 255.0).astype(np.uint8)
