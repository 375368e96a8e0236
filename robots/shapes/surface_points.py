"""Points spread evenly over a shape's surface."""

import numpy as np

from robots.shapes.geometry import FloatArray, Geometry

_GOLDEN = np.array([0.7548776662466927, 0.5698402909980532])  # of the R2 sequence: even in the plane


def surface_points(geometry: Geometry, count: int) -> FloatArray:
    """Return points (count, 3) of the triangles, by area, in the shape's units; (0, 3) if it has none.

    The same shape has the same points: no random number is drawn.
    """
    corners = [part.vertices[part.triangles] for part in geometry.parts if len(part.triangles)]
    if not corners:
        return np.empty((0, 3))
    triangles = np.concatenate(corners)
    sides = triangles[:, 1:] - triangles[:, :1]
    ends = np.cumsum(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1))
    if not np.isfinite(ends[-1]) or ends[-1] <= 0:
        return np.empty((0, 3))
    chosen = np.searchsorted(ends, (np.arange(count) + 0.5) / count * ends[-1])
    places = (np.arange(1, count + 1)[:, None] * _GOLDEN) % 1.0
    outside = places.sum(axis=1) > 1.0
    places[outside] = 1.0 - places[outside]
    points: FloatArray = triangles[chosen, 0] + np.einsum("nk,nkd->nd", places, sides[chosen])
    return points
