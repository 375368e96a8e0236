"""Simplification within an error in metres; what remains keeps the original's values at corners."""

import fast_simplification
import numpy as np

from renderer.shapes.creases import FloatArray, IntArray, face_vectors

# The simplifier merges two vertices if the squares of the new one's distances from the planes of all faces
# around them sum up to less than this, in the units of its input.
_LIBRARY_ERROR = float(np.finfo(np.float64).eps)
# A corner takes most of its values from those of the original with a normal this close to its face's.
_CLOSE = float(1.0 - np.cos(np.deg2rad(10.0)))


def simplified(
    positions: FloatArray, triangles: IntArray, values: FloatArray, *, error: float
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return positions, triangles and the values at their corners.

    Args:
        positions: (v, 3), welded [m].
        triangles: (t, 3).
        values: (t, 3, n) at the corners: a unit normal, then others.
        error: Largest distance of a vertex from the planes of the original's faces around it [m].
    """
    scale = _LIBRARY_ERROR**0.5 / error
    scaled, numbers = positions * scale, triangles.astype(np.int32)
    # The squares do not contain movements along a face, by which an open plate would shrink.
    _, _, collapses = fast_simplification.simplify(
        scaled,
        numbers,
        target_reduction=0.0,
        lossless=True,
        preserve_border=True,
        return_collapses=True,
    )
    if not len(collapses):
        return positions, triangles, values
    # Only the replay says which vertices were merged.
    points, faces, became = fast_simplification.replay_simplification(scaled, numbers, collapses)
    points, faces = points.astype(np.float64) / scale, faces.astype(np.int64)
    vectors = face_vectors(points, faces)
    size = np.linalg.norm(vectors, axis=1)
    faces, unit = faces[size > 1e-14], vectors[size > 1e-14] / size[size > 1e-14, None]
    given = values.reshape(-1, values.shape[2])
    return points, faces, _taken(faces, unit, became[triangles.reshape(-1)].astype(np.int64), given)


def _taken(faces: IntArray, unit: FloatArray, vertices: IntArray, given: FloatArray) -> FloatArray:
    """Return the (t, 3, n) values of corners: means of those that were merged into their vertex.

    Args:
        faces: (t, 3).
        unit: (t, 3) normals of the faces.
        vertices: (c,) the new vertex of each corner of the original.
        given: (c, n) its values.
    """
    # Corners of one vertex with the same normal count once.
    steps = np.round(given[:, :3] * 63.0).astype(np.int64) + 64
    _, first = np.unique(
        ((vertices * 128 + steps[:, 0]) * 128 + steps[:, 1]) * 128 + steps[:, 2], return_index=True
    )
    vertices, given = vertices[first], given[first]
    starts = np.searchsorted(vertices, np.arange(faces.max(initial=0) + 2))
    corners = faces.reshape(-1)
    # All pairs (new corner, corner of the original that was merged into its vertex) in one array.
    counts = starts[corners + 1] - starts[corners]
    corner = np.repeat(np.arange(len(corners)), counts)
    source = given[
        starts[corners][corner] + np.arange(len(corner)) - np.repeat(np.cumsum(counts) - counts, counts)
    ]
    apart = 1.0 - (source[:, :3] * unit[corner // 3]).sum(axis=1)
    weights = np.exp(-apart / _CLOSE) + 1e-100
    total = np.bincount(corner, weights=weights, minlength=len(corners))
    taken = np.stack(
        [np.bincount(corner, weights=weights * value, minlength=len(corners)) / total for value in source.T],
        axis=1,
    )
    own = np.repeat(unit, 3, axis=0)
    length = np.linalg.norm(taken[:, :3], axis=1, keepdims=True)
    normals = taken[:, :3] / np.maximum(length, 1e-9)
    # A normal must not point away from its face.
    taken[:, :3] = np.where((normals * own).sum(axis=1, keepdims=True) > 0.2, normals, own)
    return taken.reshape(-1, 3, given.shape[1])
