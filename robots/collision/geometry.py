"""Shapes as what coal checks: one convex hull a link, one a piece of a fixture, or the meshes themselves.

A hull misses no collision of its mesh, and a distance between hulls costs a hundredth of one between meshes.
"""

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np

from robots.glb import link_mesh
from robots.joints import FloatArray
from robots.kinematic_tree import Shape
from robots.meshes.mesh import IndexArray, Mesh

# Two this near touch: coal's search may end so far from the origin in bodies that overlap by millimetres.
TOUCH_M = 1e-5
# What is flat becomes a plate of this thickness: a hull needs a volume.
_THINNEST_M = 1e-4
# More points than these are joggled at once.
_MOST_EXACT = 2_000
# What coal's hulls cannot be made of is rounded to cells of this share of its extent, then to larger ones.
_FINEST_CELL = 1e-3
# A box longer than wide is covered by several balls, at most so many.
_MOST_BALLS = 6


@dataclass(frozen=True, eq=False)
class Body:
    """A hull or a mesh, in the frame of the link or fixture that it is a part of [m].

    Attributes:
        geometry: Coal's.
        center, half: (3,) of the box about it, along the axes of its frame.
        balls: (k, 3) centres of balls that cover the box.
        radius: Of each ball.
        corners: (n, 3) of its hull.
        hull: Coal's, about a mesh: never farther from another body than the mesh, and faster; None: there is
            none, or the geometry is one.
    """

    geometry: Any
    center: FloatArray
    half: FloatArray
    balls: FloatArray
    radius: float
    corners: FloatArray
    hull: Any = None


def hull_bodies(shapes: Sequence[Shape]) -> tuple[Body, ...]:
    """One hull about all shapes; none about nothing.

    Raises:
        MeshError: If a mesh file cannot be read.
    """
    vertices, _ = _solid(link_mesh(shapes))
    return (hull_body(vertices),) if len(vertices) else ()


def piece_bodies(shapes: Sequence[Shape]) -> tuple[Body, ...]:
    """One hull about each piece of the shapes that hangs together.

    Raises:
        MeshError: If a mesh file cannot be read.
    """
    vertices, triangles = _solid(link_mesh(shapes))
    return tuple(hull_body(piece) for piece in _pieces(vertices, triangles))


def exact_bodies(shapes: Sequence[Shape]) -> tuple[Body, ...]:
    """The triangles themselves: a surface, which what is wholly inside it does not touch.

    Raises:
        MeshError: If a mesh file cannot be read.
    """
    triangles = surface(shapes)
    return (exact_body(triangles),) if len(triangles) else hull_bodies(shapes)


def exact_body(triangles: FloatArray) -> Body:
    """The triangles themselves, by their corners (n, 3, 3), n at least 1."""
    vertices, numbers = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    geometry = coal.BVHModelOBBRSS()
    geometry.beginModel(len(triangles), len(vertices))
    geometry.addVertices(vertices)
    geometry.addTriangles(numbers.reshape(-1, 3))
    geometry.endModel()
    return _body(geometry, vertices)


def surface(shapes: Sequence[Shape]) -> FloatArray:
    """The triangles of shapes by their corners: (n, 3, 3) [m].

    Raises:
        MeshError: If a mesh file cannot be read.
    """
    vertices, triangles = _solid(link_mesh(shapes))
    return vertices[triangles]


def piece_points(triangles: FloatArray) -> Iterator[FloatArray]:
    """The points (k, 3) of each piece of some triangles (n, 3, 3) that hangs together."""
    vertices, numbers = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    return _pieces(vertices, numbers.reshape(-1, 3))


def hull_body(points: FloatArray) -> Body:
    """The convex hull of (n, 3) points, n at least 1."""
    hull = _convex(_with_volume(points))
    return _body(hull, np.array(hull.points()))


def _convex(points: FloatArray) -> Any:
    """Coal's hull of points, or the least coarse hull about it that coal takes.

    Coal raises RuntimeError for a vertex of more than 255 neighbours. Qhull makes one of a flat, round face,
    as whose triangles it takes a fan (Qt), in a time that grows with the square of its corners. Where it
    joggles the points by 1e-10 of their extent (QJ), it does not, but keeps more points of flat faces.
    The tip of a round cone has as many neighbours as its rim has points: those are rounded outwards.
    """
    for options in ("Qt", "QJ") if len(points) <= _MOST_EXACT else ("QJ",):
        with contextlib.suppress(RuntimeError):
            return _qhull(points, options)
    cell = _FINEST_CELL * float(np.ptp(points, axis=0).max())
    while True:
        with contextlib.suppress(RuntimeError):
            return _qhull(_about(points, cell), "Qt")
        cell *= 2


def _qhull(points: FloatArray, options: str) -> Any:
    vertices = coal.StdVec_Vec3s()
    for point in points:
        vertices.append(point)
    return coal.Convex.convexHull(vertices, False, options)


def _about(points: FloatArray, cell_m: float) -> FloatArray:
    """The corners of all cells of a grid that hold a point: they are about the points, and far fewer."""
    cells = np.unique(np.floor(points / cell_m), axis=0)
    corners = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1]), axis=-1).reshape(-1, 3)
    return np.unique((cells[:, None] + corners).reshape(-1, 3), axis=0) * cell_m


def wider(body: Body, points: FloatArray) -> Body:
    """A body whose box and balls hold some points (n, 3), too."""
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


def _solid(mesh: Mesh) -> tuple[FloatArray, IndexArray]:
    """All parts as one: vertices, and triangles that share those at the same place."""
    parts = [part for part in mesh.parts if len(part.vertices)]
    if not parts:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    triangles = np.concatenate([part.triangles + start for part, start in zip(parts, starts, strict=True)])
    vertices, numbers = np.unique(
        np.concatenate([part.vertices for part in parts]), axis=0, return_inverse=True
    )
    return vertices, numbers.reshape(-1)[triangles]


def _pieces(vertices: FloatArray, triangles: IndexArray) -> Iterator[FloatArray]:
    """The vertices of each piece whose triangles hang together."""
    labels = np.arange(len(vertices))
    while True:
        least = labels[triangles].min(axis=1)
        lower = labels.copy()
        np.minimum.at(lower, triangles.reshape(-1), np.repeat(least, 3))
        # A label is a vertex of the same piece, whose own label may be lower yet.
        lower = lower[lower]
        if (lower == labels).all():
            break
        labels = lower
    for label in np.unique(labels[triangles]):
        yield vertices[labels == label]


def _with_volume(points: FloatArray) -> FloatArray:
    """The points, doubled along each direction in which they have no extent."""
    points = np.unique(points, axis=0)
    centred = points - points.mean(axis=0)
    for direction in np.linalg.eigh(centred.T @ centred)[1].T:
        if np.ptp(points @ direction) < _THINNEST_M:
            points = np.concatenate(
                [points + direction * _THINNEST_M / 2, points - direction * _THINNEST_M / 2]
            )
    return points


def transform(placement: FloatArray) -> Any:
    """Coal's form of a (4, 4) placement."""
    return coal.Transform3s(placement[:3, :3], placement[:3, 3])
