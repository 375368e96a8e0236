"""Preparation of a link's mesh for drawing: fewer triangles, smooth curved surfaces, sharp edges."""

from collections.abc import Sequence
from dataclasses import dataclass

import fast_simplification
import numpy as np
from numpy.typing import NDArray

from renderer.creases import CREASE, FloatArray, IntArray, crease_normals, sharp_edges, weld
from renderer.glb import Surface, read_glb
from renderer.occlusion import open_sky
from renderer.vertex_light import SCALES, ordered

# More triangles take time for each picture and hardly change it (96,000 instead of 20,000 for a
# whole arm: 37 instead of 18 ms at 720p).
MOST_TRIANGLES = 4_000
_SHADOW_TRIANGLES = 300
# How fast the simplifier's steps grow (its default: 7).
_GENTLE = 3.0
# 1: every material loses the same share of its triangles; 0: all keep the same number.
_EVENNESS = 0.55
# A simplified round surface has larger angles between faces.
_COARSE_CREASE = float(np.deg2rad(48.0))
_PLAIN_COLOR = (0.62, 0.64, 0.66, 1.0)


# A vertex in the layout of the OpenGL buffer.
VERTEX = np.dtype([("position", "f4", 3), ("normal", "f4", 3), ("color", "u1", 4), ("surface", "u1", 4)])


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in the link's frame [m].

    Attributes:
        positions: (v, 3) float32.
        normals: (v, 3) float32, unit.
        colors: (v, 4) uint8, sRGB and opacity.
        surface: (v, 4) uint8: the share of the sky that the vertex sees past its own link,
            roughness, metalness, unused.
        triangles: (t, 3) uint32, vertex numbers.
        vertex_lit: Number of the first triangles that are lit at their vertices, for each of
            `renderer.vertex_light.SCALES`.
        edges: (2e, 3) float32, ends of the sharp edges.
        shadow: (3s, 3) float32, a coarse copy that casts the shadow.
    """

    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    colors: NDArray[np.uint8]
    surface: NDArray[np.uint8]
    triangles: NDArray[np.uint32]
    vertex_lit: NDArray[np.uint32]
    edges: NDArray[np.float32]
    shadow: NDArray[np.float32]

    @property
    def transparent(self) -> bool:
        """True if any vertex is transparent."""
        return bool((self.colors[:, 3] < 255).any())


def prepared(glb: bytes, *, color: str = "", most_triangles: int = MOST_TRIANGLES) -> Mesh:
    """Return a mesh prepared from GLB.

    Args:
        color: "#rrggbb" for surfaces without a colour in the file.
        most_triangles: A mesh with more triangles is simplified to about this number.

    Raises:
        GlbError: If it is not GLB.
    """
    surfaces = [surface for surface in read_glb(glb) if len(surface.triangles)]
    counts = np.array([len(surface.triangles) for surface in surfaces], dtype=np.float64)
    kept = np.ones(len(counts))
    if counts.sum() > most_triangles:
        # A small part keeps a larger share of its triangles, or a round cap would become a polygon.
        shares = counts**_EVENNESS
        kept = np.minimum(1.0, most_triangles * shares / shares.sum() / counts)
    plain = srgb(color) if color else _PLAIN_COLOR
    bodies = [_Body.of(surface, plain, float(share)) for surface, share in zip(surfaces, kept, strict=True)]
    corners = _joined([body.corners() for body in bodies], 3)
    vertices = np.zeros(len(corners), dtype=VERTEX)
    vertices["position"] = corners
    vertices["normal"] = np.round(_joined([body.normals.reshape(-1, 3) for body in bodies], 3), 4)
    vertices["color"] = _bytes(_joined([body.colors.reshape(-1, 4) for body in bodies], 4))
    vertices["surface"] = _bytes(_joined([body.surface() for body in bodies], 4))
    # Merged vertices are shaded once, which saves a third of the time in software OpenGL.
    unique, numbers = _unique(vertices)
    points, normals = (unique[name].astype(np.float64) for name in ("position", "normal"))
    unique["surface"][:, 0] = np.round(open_sky(points, normals, numbers.reshape(-1, 3)) * 255.0)
    triangles, vertex_lit = numbers.reshape(-1, 3), np.zeros(len(SCALES), dtype=np.uint32)
    if (unique["color"][:, 3] == 255).all():  # the order of transparent triangles is visible
        triangles, vertex_lit = ordered(points, normals, unique["surface"][:, 1] / 255.0, triangles)
    return Mesh(
        positions=unique["position"],
        normals=unique["normal"],
        colors=unique["color"],
        surface=unique["surface"],
        triangles=triangles,
        vertex_lit=vertex_lit,
        edges=_joined([body.edges.reshape(-1, 3) for body in bodies], 3).astype(np.float32),
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
    roughness: float
    metallic: float

    @classmethod
    def of(cls, surface: Surface, plain: tuple[float, float, float, float], kept: float) -> "_Body":
        color = np.array(surface.color or plain)
        if kept < 1.0:
            positions, triangles = _simplified(*weld(surface.positions, surface.triangles), kept)
        else:
            positions, triangles = weld(surface.positions, surface.triangles)
        crease = CREASE if kept == 1.0 else _COARSE_CREASE
        untouched = kept == 1.0 and len(triangles) == len(surface.triangles)
        colors = np.tile(color, (len(triangles), 3, 1))
        if untouched and surface.colors is not None:
            colors = surface.colors[surface.triangles] * (color if surface.color else 1.0)
        elif surface.colors is not None:
            # Simplification loses the vertices' colours: their mean is a better substitute than white.
            colors = colors * surface.colors.mean(axis=0)
        if untouched and surface.normals is not None:
            normals = surface.normals[surface.triangles]
        else:
            normals = crease_normals(positions, triangles, crease=crease)
        return cls(
            positions=positions,
            triangles=triangles,
            normals=normals,
            colors=colors,
            edges=sharp_edges(positions, triangles, crease=crease),
            roughness=surface.roughness,
            metallic=surface.metallic,
        )

    def corners(self) -> FloatArray:
        return self.positions[self.triangles].reshape(-1, 3)

    def surface(self) -> FloatArray:
        return np.tile((1.0, self.roughness, self.metallic, 0.0), (3 * len(self.triangles), 1))


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
