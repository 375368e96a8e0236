"""Polygons to triangles: fans where they are convex, ears where they are not."""

import numpy as np

from robots.meshes.mesh import FloatArray, IndexArray


def split_at_minus_one(indices: IndexArray) -> list[IndexArray]:
    """The runs between the -1 of a VRML index list; the last may do without its -1."""
    ends = np.flatnonzero(indices < 0)
    runs = np.split(indices, ends)
    return [run[run >= 0] for run in runs]


def fan(count: int) -> IndexArray:
    """(count - 2, 3) corners of a convex polygon's triangles."""
    steps = np.arange(1, count - 1)
    return np.column_stack([np.zeros_like(steps), steps, steps + 1])


def ears(corners: FloatArray) -> IndexArray:
    """(n - 2, 3) corners of the triangles of any simple polygon, in its own order, by ear clipping.

    Args:
        corners: (n, 3), in a plane or nearly.
    """
    normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
    # Seen along the largest axis of the normal, so that the polygon keeps its shape and its sense.
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(corners, axis, axis=1)
    if (normal[axis] < 0) != (axis == 1):
        flat = flat[:, ::-1]
    left = list(range(len(corners)))
    triangles = []
    while len(left) > 3:
        ear = _find_ear(flat, left)
        triangles.append([left[ear - 1], left[ear], left[(ear + 1) % len(left)]])
        del left[ear]
    triangles.append(left)
    return np.array(triangles)


def _find_ear(flat: FloatArray, left: list[int]) -> int:
    best, best_turn = 0, float("-inf")
    for index in range(len(left)):
        a, b, c = flat[left[index - 1]], flat[left[index]], flat[left[(index + 1) % len(left)]]
        turn = float(_cross(b - a, c - b))
        if turn > best_turn:
            best, best_turn = index, turn
        if turn <= 0:
            continue
        corners = {left[index - 1], left[index], left[(index + 1) % len(left)]}
        others = flat[[k for k in left if k not in corners]]
        inside = (
            (_cross(b - a, others - a) >= 0)
            & (_cross(c - b, others - b) >= 0)
            & (_cross(a - c, others - c) >= 0)
        )
        # A bridge to a hole visits a point twice: a corner at the same place does not spoil the ear.
        same = (others[:, None] == np.array([a, b, c])).all(axis=-1).any(axis=-1)
        if not (inside & ~same).any():
            return index
    # None is clean (it crosses itself): the sharpest corner keeps the area about right.
    return best


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    result: FloatArray = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    return result
