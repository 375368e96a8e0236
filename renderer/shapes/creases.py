"""Normals and sharp edges by the crease angle: round surfaces are smooth, edges sharp."""

import numpy as np
from numpy.typing import NDArray

from robots.shapes.normals import crease_normals

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# A surface is smooth where two faces meet at a smaller angle.
CREASE = float(np.deg2rad(38.0))
# Closer vertices are merged: exporters split them to store several normals.
_WELD_M = 1e-5


def weld(positions: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Merge vertices at the same position, and drop triangles without area."""
    _, first, number = np.unique(
        np.round(positions / _WELD_M).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    welded = number.reshape(-1)[triangles]
    a, b, c = welded.T
    kept = welded[(a != b) & (b != c) & (c != a)]
    points = positions[first]
    return points, kept[np.linalg.norm(face_vectors(points, kept), axis=1) > 1e-14]


def face_vectors(positions: FloatArray, triangles: IntArray) -> FloatArray:
    """Return (t, 3) outward normals with a length of twice the area."""
    a, b, c = (positions[triangles[:, corner]] for corner in range(3))
    vectors: FloatArray = np.cross(b - a, c - a)
    return vectors


def corner_normals(positions: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (t, 3, 3) normal of each corner: the mean over adjacent faces that no crease separates.

    Args:
        positions: (v, 3), welded.
        triangles: (t, 3).
    """
    owners = np.repeat(np.arange(len(triangles)), 3)
    vectors = face_vectors(positions, triangles)
    return crease_normals(triangles.ravel(), owners, vectors, CREASE).reshape(-1, 3, 3)


def sharp_edges(positions: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (e, 2, 3) ends of the sharp edges."""
    vectors = face_vectors(positions, triangles)
    unit = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    faces = np.tile(np.arange(len(triangles)), 3)
    keys = np.sort(sides, axis=1)
    order = np.lexsort((keys[:, 1], keys[:, 0]))
    keys, faces = keys[order], faces[order]
    pair = np.nonzero((keys[1:] == keys[:-1]).all(axis=1))[0]
    sharp = (unit[faces[pair]] * unit[faces[pair + 1]]).sum(axis=1) < np.cos(CREASE)
    ends: FloatArray = positions[keys[pair[sharp]]]
    return ends
