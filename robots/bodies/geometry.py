"""Coal's geometry of shapes: one convex hull per link, one per piece of a fixture, or exact triangles.

A hull misses no collision of its shape, and the distance of two hulls takes 1 % of the time of two surfaces.
"""

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np

from robots.descriptions.glb import link_geometry
from robots.kinematics.joints import FloatArray
from robots.kinematics.kinematic_tree import Shape
from robots.shapes.geometry import Geometry, IndexArray

# Bodies within this distance touch: coal may return so much for bodies that overlap by millimetres.
TOUCH_M = 1e-5
# Flat shapes become plates of this thickness, because a hull needs a volume.
_THINNEST_M = 1e-4
# For more points than this, qhull is called only with joggling.
_MOST_EXACT = 2_000
# If coal rejects a hull, the points are rounded to cells of this share of the extent, then to larger cells.
_FINEST_CELL = 1e-3
# Largest number of balls that cover a long box.
_MOST_BALLS = 6


@dataclass(frozen=True, eq=False)
class Body:
    """A hull or triangles, in the frame of its link or fixture [m].

    Attributes:
        geometry: Coal's geometry.
        center, half: (3,) of the bounding box, along the axes of the frame.
        balls: (k, 3) centres of balls that cover the box.
        radius: The radius of each ball.
        corners: (n, 3) of the hull.
        hull: Coal's hull of triangles, for fast lower bounds of its distances; None if there is none or the
            geometry is a hull.
    """

    geometry: Any
    center: FloatArray
    half: FloatArray
    balls: FloatArray
    radius: float
    corners: FloatArray
    hull: Any = None


def hull_bodies(shapes: Sequence[Shape]) -> tuple[Body, ...]:
    """Return one hull of all shapes; empty if they have no vertices.

    Raises:
        ShapeError: If a shape file cannot be read.
    """
    vertices, _ = _solid(link_geometry(shapes))
    return (hull_body(vertices),) if len(vertices) else ()


def piece_bodies(shapes: Sequence[Shape]) -> tuple[Body, ...]:
    """Return one hull for each connected piece of the shapes.

    Raises:
        ShapeError: If a shape file cannot be read.
    """
    vertices, triangles = _solid(link_geometry(shapes))
    return tuple(hull_body(piece) for piece in _pieces(vertices, triangles))


def exact_bodies(shapes: Sequence[Shape]) -> tuple[Body, ...]:
    """Return the triangles as one body: a surface, so a body completely inside it does not touch it.

    Raises:
        ShapeError: If a shape file cannot be read.
    """
    triangles = surface(shapes)
    return (exact_body(triangles),) if len(triangles) else hull_bodies(shapes)


def exact_body(triangles: FloatArray) -> Body:
    """Return triangles, given by their corners (n, 3, 3), n at least 1, as a body."""
    vertices, numbers = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    geometry = coal.BVHModelOBBRSS()
    geometry.beginModel(len(triangles), len(vertices))
    geometry.addVertices(vertices)
    geometry.addTriangles(numbers.reshape(-1, 3))
    geometry.endModel()
    return _body(geometry, vertices)


def surface(shapes: Sequence[Shape]) -> FloatArray:
    """Return the triangles of shapes by their corners: (n, 3, 3) [m].

    Raises:
        ShapeError: If a shape file cannot be read.
    """
    vertices, triangles = _solid(link_geometry(shapes))
    return vertices[triangles]


def piece_points(triangles: FloatArray) -> Iterator[FloatArray]:
    """Return the points (k, 3) of each connected piece of triangles (n, 3, 3)."""
    vertices, numbers = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    return _pieces(vertices, numbers.reshape(-1, 3))


def hull_body(points: FloatArray) -> Body:
    """Return the convex hull of (n, 3) points, n at least 1."""
    hull = _convex(_with_volume(points))
    return _body(hull, np.array(hull.points()))


def _convex(points: FloatArray) -> Any:
    """Return coal's hull of points, or the finest hull around it that coal accepts.

    Coal raises RuntimeError for a vertex with more than 255 neighbours. With option Qt, qhull creates such a
    vertex in a flat, round face, which it triangulates as a fan, in a time quadratic in the corners. Option
    QJ joggles the points by 1e-10 of their extent. It avoids this, but keeps more points of flat faces. The
    tip of a round cone has as many neighbours as its rim has points; these points are rounded outwards.
    """
    for options in ("Qt", "QJ") if len(points) <= _MOST_EXACT else ("QJ",):
        with contextlib.suppress(RuntimeError):
            return _qhull(points, options)
    cell = _FINEST_CELL * float(np.ptp(points, axis=0).max())
    while True:
        with contextlib.suppress(RuntimeError):
            return _qhull(_grid_cover(points, cell), "Qt")
        cell *= 2


def _qhull(points: FloatArray, options: str) -> Any:
    vertices = coal.StdVec_Vec3s()
    for point in points:
        vertices.append(point)
    return coal.Convex.convexHull(vertices, False, options)


def _grid_cover(points: FloatArray, cell_m: float) -> FloatArray:
    """Return the corners of all grid cells that contain a point: far fewer points with a hull around them."""
    cells = np.unique(np.floor(points / cell_m), axis=0)
    corners = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1]), axis=-1).reshape(-1, 3)
    return np.unique((cells[:, None] + corners).reshape(-1, 3), axis=0) * cell_m


def enlarged(body: Body, points: FloatArray) -> Body:
    """Return a body with box and balls enlarged to contain points (n, 3)."""
    corners = np.array([body.center - body.half, body.center + body.half])
    return _body(body.geometry, np.concatenate([points, corners]))


def _body(geometry: Any, points: FloatArray) -> Body:
    geometry.computeLocalAABB()
    low, high = points.min(axis=0), points.max(axis=0)
    center, half = (low + high) / 2, (high - low) / 2
    longest = int(half.argmax())
    wide = max(float(np.delete(half, longest).max()), _THINNEST_M)
    count = int(np.clip(np.ceil(half[longest] / wide), 1, _MOST_BALLS))
    part = half.copy()
    part[longest] /= count
    balls = np.tile(center, (count, 1))
    balls[:, longest] += -half[longest] + part[longest] * (2 * np.arange(count) + 1)
    return Body(geometry, center, half, balls, float(np.linalg.norm(part)), points)


def _solid(geometry: Geometry) -> tuple[FloatArray, IndexArray]:
    """Join all parts: return vertices, and triangles that share equal vertices."""
    parts = [part for part in geometry.parts if len(part.vertices)]
    if not parts:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    triangles = np.concatenate([part.triangles + start for part, start in zip(parts, starts, strict=True)])
    vertices, numbers = np.unique(
        np.concatenate([part.vertices for part in parts]), axis=0, return_inverse=True
    )
    return vertices, numbers.reshape(-1)[triangles]


def _pieces(vertices: FloatArray, triangles: IndexArray) -> Iterator[FloatArray]:
    """Yield the vertices of each connected piece."""
    labels = np.arange(len(vertices))
    while True:
        least = labels[triangles].min(axis=1)
        lower = labels.copy()
        np.minimum.at(lower, triangles.reshape(-1), np.repeat(least, 3))
        # A label is the number of a vertex in the same piece, which may have a lower label itself.
        lower = lower[lower]
        if (lower == labels).all():
            break
        labels = lower
    for label in np.unique(labels[triangles]):
        yield vertices[labels == label]


def _with_volume(points: FloatArray) -> FloatArray:
    """Return the points, duplicated along each direction in which they have no extent."""
    points = np.unique(points, axis=0)
    centred = points - points.mean(axis=0)
    for direction in np.linalg.eigh(centred.T @ centred)[1].T:
        if np.ptp(points @ direction) < _THINNEST_M:
            points = np.concatenate(
                [points + direction * _THINNEST_M / 2, points - direction * _THINNEST_M / 2]
            )
    return points


def transform(placement: FloatArray) -> Any:
    """Convert a (4, 4) placement to coal's form."""
    return coal.Transform3s(placement[:3, :3], placement[:3, 3])
