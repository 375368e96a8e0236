"""Choice of the triangles that are lit at their vertices: in software, light at each pixel costs much more.

A triangle's colours differ little between both ways if its normals turn little in comparison to the size of
a highlight, or if it is a few pixels wide. So each triangle has a largest scale up to which its vertices are
enough, and a shape begins with the triangles of the largest scales.
"""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Scales of a picture [px/m], the largest first: from a hand in close-up to a whole hall.
SCALES: FloatArray = 2.0 ** np.arange(14.0, 2.0, -0.5)
# A highlight is as wide as the surface is rough: largest turn of the normals over the roughness [rad].
_MOST_TURN = 1.0
# Longest side [px]. On longer ones the view's direction differs noticeably too.
_SMOOTH_PX, _CURVED_PX = 200.0, 4.0


def ordered(
    positions: FloatArray, normals: FloatArray, roughness: FloatArray, triangles: NDArray[np.uint32]
) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Return the triangles by their largest scale, and the number of triangles for each of `SCALES`.

    Args:
        positions: (v, 3) [m].
        normals: (v, 3), unit.
        roughness: (v,) 0 to 1, the same at a triangle's corners.
        triangles: (t, 3) vertex numbers.
    """
    corners, directions = positions[triangles], normals[triangles]
    longest = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2).max(axis=1)
    turn = np.arccos(np.clip((directions * directions[:, [1, 2, 0]]).sum(axis=2).min(axis=1), -1.0, 1.0))
    smooth = turn < _MOST_TURN * roughness[triangles[:, 0]]
    largest = np.where(smooth, _SMOOTH_PX, _CURVED_PX) / np.maximum(longest, 1e-9)
    step = np.searchsorted(-SCALES, -largest)
    order = np.argsort(step, kind="stable")
    counts = np.searchsorted(step[order], np.arange(len(SCALES)), side="right")
    return triangles[order], counts.astype(np.uint32)


def counts_at(scales: FloatArray, counts: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return how many of their first triangles n shapes light at vertices, at n scales [px/m].

    Args:
        scales: (n,).
        counts: (n, s) of each shape, from `ordered`.
    """
    steps = np.searchsorted(-SCALES, -scales, side="right") - 1  # the smallest that is not smaller
    found: NDArray[np.uint32] = np.where(steps < 0, 0, counts[np.arange(len(scales)), steps])
    return found
