"""Normals where a file gives none: smooth over gentle edges, sharp at creases."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from robots.meshes.mesh import FloatArray, IndexArray, unit

Split = tuple[FloatArray, FloatArray, IndexArray]
_Flags = NDArray[np.bool_]


def creased(vertices: FloatArray, triangles: IndexArray, crease_angle: float) -> Split:
    """Vertices split where faces meet at more than the crease angle.

    Args:
        vertices: (v, 3).
        triangles: (t, 3).
        crease_angle: Faces that meet at less are drawn as one smooth surface [rad]; 0: flat facets.

    Returns:
        Vertices (w, 3), normals (w, 3) and triangles (t, 3), the same surface.
    """
    facing = unit(_face_normals(vertices, triangles))
    limit = np.cos(crease_angle)

    def smooth(one: IndexArray, other: IndexArray) -> _Flags:
        alike: _Flags = np.einsum("ij,ij->i", facing[one], facing[other]) > limit
        return alike

    return _split(vertices, triangles, smooth)


def grouped(vertices: FloatArray, triangles: IndexArray, groups: IndexArray) -> Split:
    """As `creased`, by 3DS smoothing groups: faces are smooth together that share a bit of (t,) `groups`."""

    def smooth(one: IndexArray, other: IndexArray) -> _Flags:
        share: _Flags = (groups[one] & groups[other]) != 0
        return share

    return _split(vertices, triangles, smooth)


def _face_normals(vertices: FloatArray, triangles: IndexArray) -> FloatArray:
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    return np.asarray(np.cross(b - a, c - a), dtype=np.float64)


def _split(
    vertices: FloatArray, triangles: IndexArray, smooth: Callable[[IndexArray, IndexArray], _Flags]
) -> Split:
    """Each corner's normal from the faces at its vertex that are smooth with its own."""
    if not len(triangles):
        return vertices, np.zeros_like(vertices), triangles
    areas = _face_normals(vertices, triangles)
    first, second = _corners_at_one_vertex(triangles.ravel())
    together = smooth(first // 3, second // 3) | (first == second)
    normals = np.zeros((triangles.size, 3))
    # Weighted by area: the small triangles of a fillet must not tilt the plane beside it.
    np.add.at(normals, first[together], areas[second[together] // 3])
    normals = unit(normals)
    corners = np.column_stack([triangles.ravel(), np.round(normals * 2048)]).astype(np.int64)
    _, kept, corner_vertex = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    return vertices[corners[kept, 0]], normals[kept], corner_vertex.reshape(-1, 3).astype(np.int64)


def _corners_at_one_vertex(corner_vertices: IndexArray) -> tuple[IndexArray, IndexArray]:
    """All ordered pairs of triangle corners that share a vertex, each corner with itself too."""
    order = np.argsort(corner_vertices, kind="stable")
    _, starts, counts = np.unique(corner_vertices[order], return_index=True, return_counts=True)
    # Corner k of a vertex with c corners is repeated c times, beside the c corners in turn.
    per_corner = np.repeat(counts, counts)
    first = np.repeat(order, per_corner)
    run_starts = np.repeat(np.repeat(starts, counts), per_corner)
    position = np.arange(len(first)) - np.repeat(np.cumsum(per_corner) - per_corner, per_corner)
    return first, order[run_starts + position]
