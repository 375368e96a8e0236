"""Ambient occlusion: the share of the sky that each vertex sees; corners and hollows are darker."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.integer]

# Cells along the longest side, number of directions, and steps of one cell in each direction.
_CELLS, _DIRECTIONS, _STEPS = 40, 48, 10
# Empty cells around the body.
_PAD = 4
# Samples of a triangle per cell area, and largest total number.
_DENSITY, _MOST_SAMPLES = 6.0, 400_000
# Share of a vertex that sees no sky: the cells close gaps that let light through.
_LEAST = 0.35


def open_sky(positions: FloatArray, normals: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (v,) share of its half-space that each vertex sees; 1 if nothing is close.

    Args:
        positions: (v, 3) [m].
        normals: (v, 3) outward, unit.
        triangles: (t, 3) vertex numbers.
    """
    if len(triangles) == 0:
        return np.ones(len(positions))
    low = positions.min(axis=0)
    cell = max(float(np.ptp(positions, axis=0).max()), 1e-9) / _CELLS
    filled = _filled((positions - low) / cell, triangles)
    open_directions, weights = np.zeros((2, len(positions)))
    # Begin two cells above the surface, so that it does not hide itself.
    start = (positions - low) / cell + 2.0 * normals + _PAD
    for direction in _directions(_DIRECTIONS):
        facing = np.maximum(normals @ direction, 0.0)
        seen = facing > 0.15
        free = np.ones(int(seen.sum()), dtype=bool)
        at = start[seen]
        for _ in range(_STEPS):
            inside = np.clip(at.astype(np.int64), 0, _CELLS + 2 * _PAD - 1)
            free &= ~filled[inside[:, 0], inside[:, 1], inside[:, 2]]
            at = at + direction
        weights[seen] += facing[seen]
        open_directions[seen] += facing[seen] * free
    share: FloatArray = open_directions / np.maximum(weights, 1e-9)
    return _LEAST + (1.0 - _LEAST) * np.where(weights > 0.0, share, 1.0)


def _filled(places: FloatArray, triangles: IntArray) -> NDArray[np.bool_]:
    """Return a mask of the cells that contain sample points of the triangles; positions are in cells."""
    a, b, c = (places[triangles[:, corner]] for corner in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
    count = np.ceil(area * _DENSITY).astype(np.int64) + 1
    if count.sum() > _MOST_SAMPLES:
        count = np.maximum(count * _MOST_SAMPLES // count.sum(), 1)
    which = np.repeat(np.arange(len(a)), count)
    random = np.random.default_rng(0)
    u, v = random.random((2, len(which), 1))
    over = u + v > 1.0
    u, v = np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v)
    points = a[which] + u * (b - a)[which] + v * (c - a)[which]
    cells = points.astype(np.int64) + _PAD
    filled = np.zeros((_CELLS + 2 * _PAD,) * 3, dtype=bool)
    inside = np.clip(cells, 0, _CELLS + 2 * _PAD - 1)
    filled[inside[:, 0], inside[:, 1], inside[:, 2]] = True
    return filled


def _directions(count: int) -> FloatArray:
    """Return (count, 3) unit vectors spread evenly over the sphere (a Fibonacci lattice)."""
    index = np.arange(count) + 0.5
    z = 1.0 - 2.0 * index / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * index
    flat = np.sqrt(1.0 - z * z)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
