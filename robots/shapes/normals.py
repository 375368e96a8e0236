"""Vertex normals for files without them: smooth across gentle edges, sharp at creases."""

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from robots.shapes.geometry import FloatArray, IndexArray, unit
from robots.shapes.polygons import area_vectors

Split = tuple[FloatArray, FloatArray, IndexArray]
_Flags = NDArray[np.bool_]
# Returns for each k whether faces `one[k]` and `other[k]` are smoothed together.
_Smooth = Callable[[IndexArray, IndexArray], _Flags]

# Pairs of corners in one batch: some tens of MB.
_PAIRS = 200_000
# A vertex with more faces, like the tip of a fine cone, stays faceted: it would have millions of pairs.
_MOST_AT_ONE_VERTEX = 700


def creased(vertices: FloatArray, triangles: IndexArray, crease_angle: float) -> Split:
    """Split vertices where faces meet at more than the crease angle, and compute normals.

    Args:
        vertices: (v, 3).
        triangles: (t, 3).
        crease_angle: Faces that meet at a smaller angle [rad] become one smooth surface; 0: flat facets.

    Returns:
        Vertices (w, 3), normals (w, 3) and triangles (t, 3) of the same surface.
    """
    areas = _areas(vertices, triangles)
    normals = crease_normals(triangles.ravel(), np.repeat(np.arange(len(triangles)), 3), areas, crease_angle)
    return joined(vertices, triangles, normals)


def grouped(vertices: FloatArray, triangles: IndexArray, groups: IndexArray) -> Split:
    """Split vertices by 3DS smoothing groups; faces that share a bit of (t,) `groups` become smooth.

    Returns the same arrays as `creased`.
    """

    def smooth(one: IndexArray, other: IndexArray) -> _Flags:
        share: _Flags = (groups[one] & groups[other]) != 0
        return share

    owners = np.repeat(np.arange(len(triangles)), 3)
    normals = _corner_normals(triangles.ravel(), owners, _areas(vertices, triangles), smooth)
    return joined(vertices, triangles, normals)


def crease_normals(
    corners: IndexArray, owners: IndexArray, areas: FloatArray, crease_angle: float
) -> FloatArray:
    """Return the (c, 3) normal of each corner, averaged over the faces that meet at less than the angle.

    Args:
        corners: (c,) vertex number of each corner.
        owners: (c,) face number of each corner.
        areas: (f, 3) face normals, with the length of the face's area.
        crease_angle: [rad].
    """
    sums = [np.bincount(corners, weights=areas[owners, axis]) for axis in range(3)]
    normals = unit(np.column_stack(sums).astype(np.float64))[corners]
    if crease_angle >= np.pi:
        return normals
    facing = unit(areas)
    # Faces within half the angle of their mean direction meet at less than the angle. Most vertices pass
    # this quick test.
    far = np.einsum("ij,ij->i", facing[owners], normals) <= np.cos(crease_angle / 2)
    rough = (np.bincount(corners, weights=far) > 0)[corners]
    limit = np.cos(crease_angle)

    def smooth(one: IndexArray, other: IndexArray) -> _Flags:
        alike: _Flags = np.einsum("ij,ij->i", facing[one], facing[other]) > limit
        return alike

    normals[rough] = _corner_normals(corners[rough], owners[rough], areas, smooth)
    return normals


def joined(points: FloatArray, corners: IndexArray, normals: FloatArray) -> Split:
    """Merge corners that have one point and (nearly) one normal into one vertex.

    Args:
        corners: (t, 3) point number of each corner of each triangle.
        normals: (3 t, 3) normal of each corner.
    """
    keys = corner_keys(corners.ravel(), normals)
    _, kept, vertex = np.unique(keys, return_index=True, return_inverse=True)
    return points[corners.ravel()[kept]], normals[kept], vertex.reshape(-1, 3).astype(np.int64)


def corner_keys(corners: IndexArray, normals: FloatArray) -> IndexArray:
    """Return a (c,) key from the point and the normal of each corner; equal keys mean one vertex.

    Normals are rounded to 1/1024; point numbers may go up to 2**30.
    """
    rounded = np.round(normals * 1023).astype(np.int64) + 1023
    keys: IndexArray = (corners << 33) | (rounded[:, 0] << 22) | (rounded[:, 1] << 11) | rounded[:, 2]
    return keys


def _areas(vertices: FloatArray, triangles: IndexArray) -> FloatArray:
    return area_vectors(vertices, triangles.ravel(), np.full(len(triangles), 3))


def _corner_normals(
    corners: IndexArray, owners: IndexArray, areas: FloatArray, smooth: _Smooth
) -> FloatArray:
    """Return each corner's normal from the faces at its vertex that are smoothed with the corner's face."""
    # Weighted by area: the small triangles of a fillet must not tilt the plane next to it.
    sums = areas[owners]
    for first, second in _pairs(corners):
        kept = smooth(owners[first], owners[second])
        ones, others = first[kept], owners[second[kept]]
        for axis in range(3):
            sums[:, axis] += np.bincount(ones, weights=areas[others, axis], minlength=len(corners))
    return unit(sums)


def _pairs(corners: IndexArray) -> Iterator[tuple[IndexArray, IndexArray]]:
    """Yield all ordered pairs of different corners that share a vertex, in batches."""
    order = np.argsort(corners, kind="stable")
    ranked = corners[order]
    starts = np.flatnonzero(np.diff(ranked, prepend=-1))
    counts = np.diff(starts, append=len(ranked))
    few = counts <= _MOST_AT_ONE_VERTEX
    starts, counts = starts[few], counts[few]
    piece = np.cumsum(counts**2) // _PAIRS
    edges = [0, *(np.flatnonzero(np.diff(piece)) + 1).tolist(), len(piece)]
    for low, high in pairwise(edges):
        first, second = _pairs_of(order, starts[low:high], counts[low:high])
        different = first != second
        yield first[different], second[different]


def _pairs_of(order: IndexArray, starts: IndexArray, counts: IndexArray) -> tuple[IndexArray, IndexArray]:
    # Corner k of a vertex with c corners is repeated c times, paired with each of the c corners.
    per_vertex = counts**2
    run = np.repeat(np.arange(len(counts)), per_vertex)
    within = np.arange(len(run)) - np.repeat(np.cumsum(per_vertex) - per_vertex, per_vertex)
    return order[starts[run] + within // counts[run]], order[starts[run] + within % counts[run]]
