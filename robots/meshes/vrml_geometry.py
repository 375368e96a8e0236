"""VRML 2.0 geometry nodes to triangles: IndexedFaceSet, Box, Cone, Cylinder, Sphere.

Source: ISO/IEC 14772-1:1997, clause 6 (each node's own).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robots.meshes.mesh import FloatArray, IndexArray, unit
from robots.meshes.normals import creased
from robots.meshes.polygons import ears, fan, split_at_minus_one
from robots.meshes.solids import ball, box, turned
from robots.meshes.vrml_parser import Node
from robots.meshes.vrml_values import flag, indices, line_error, node_of, numbers, rows

SEGMENTS = 32


@dataclass(frozen=True, eq=False)
class Geometry:
    """Triangles with normals; not solid: seen from both sides."""

    vertices: FloatArray
    normals: FloatArray
    triangles: IndexArray
    solid: bool = True


def _indexed_face_set(node: Node, path: Path) -> Geometry:
    points = rows(node_of(node, "coord"), "point", 3, path)
    polygons = split_at_minus_one(indices(node, "coordIndex", len(points), path))
    convex = flag(node, "convex", True)
    # For each triangle: which polygon, and which corners of it.
    owners, corners = [], []
    for number, polygon in enumerate(polygons):
        if len(polygon) < 3:
            continue
        cut = fan(len(polygon)) if convex or len(polygon) == 3 else ears(points[polygon])
        owners.append(np.full(len(cut), number))
        corners.append(cut)
    solid = flag(node, "solid", True)
    if not corners:
        return Geometry(points, np.zeros_like(points), np.zeros((0, 3), dtype=np.int64), solid)
    starts = np.cumsum([0, *(len(polygon) for polygon in polygons)])[:-1]
    owner, corner = np.concatenate(owners), np.concatenate(corners)
    # Numbers of the corners in the flat list of all corners of all polygons.
    flat = starts[owner][:, None] + corner
    triangles = np.concatenate(polygons)[flat]
    clockwise = not flag(node, "ccw", True)
    normals = _given_normals(node, path, polygons, owner, flat, triangles)
    if normals is None:
        if clockwise:
            triangles = triangles[:, ::-1]
        crease = float(numbers(node, "creaseAngle", [0.0], path)[0])
        return Geometry(*creased(points, triangles, crease), solid)
    vertices, normals, triangles = _joined(points, normals, triangles)
    if clockwise:
        triangles = triangles[:, ::-1]
    return Geometry(vertices, normals, triangles, solid)


def _given_normals(
    node: Node,
    path: Path,
    polygons: list[IndexArray],
    owner: IndexArray,
    flat: IndexArray,
    triangles: IndexArray,
) -> FloatArray | None:
    """(t, 3, 3): the file's normal at each corner of each triangle; None where it has none."""
    vectors = unit(rows(node_of(node, "normal"), "vector", 3, path))
    if not len(vectors):
        return None
    given = indices(node, "normalIndex", len(vectors), path)
    if flag(node, "normalPerVertex", True):
        runs = split_at_minus_one(given) if len(given) else polygons
        if [len(run) for run in runs] != [len(polygon) for polygon in polygons]:
            raise line_error(path, node, "normalIndex does not have the polygons of coordIndex")
        chosen = np.concatenate(runs)[flat]
    else:
        chosen = np.repeat((given if len(given) else np.arange(len(polygons)))[owner][:, None], 3, axis=1)
    if len(chosen) and chosen.max() >= len(vectors):
        raise line_error(path, node, f"has {len(vectors)} normals, too few for its points")
    return vectors[chosen]


def _joined(
    points: FloatArray, normals: FloatArray, triangles: IndexArray
) -> tuple[FloatArray, FloatArray, IndexArray]:
    """Corners of one point and one normal become one vertex."""
    keys = np.column_stack([triangles.ravel(), np.round(normals.reshape(-1, 3) * 2048)]).astype(np.int64)
    _, kept, vertex = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return points[keys[kept, 0]], normals.reshape(-1, 3)[kept], vertex.reshape(-1, 3).astype(np.int64)


def _box(node: Node, path: Path) -> Geometry:
    size = numbers(node, "size", [2.0, 2.0, 2.0], path, 3)
    return Geometry(*creased(*box(-size / 2, size / 2), 0.0))


def _sphere(node: Node, path: Path) -> Geometry:
    return Geometry(*creased(*ball(float(numbers(node, "radius", [1.0], path)[0]), SEGMENTS), np.pi))


def _cylinder(node: Node, path: Path) -> Geometry:
    radius = float(numbers(node, "radius", [1.0], path)[0])
    half = float(numbers(node, "height", [2.0], path)[0]) / 2
    side = [(radius, -half), (radius, half)] if flag(node, "side", True) else []
    return _about_y(_profiles([(0.0, -half), (radius, -half)], side, [(radius, half), (0.0, half)], node))


def _cone(node: Node, path: Path) -> Geometry:
    radius = float(numbers(node, "bottomRadius", [1.0], path)[0])
    half = float(numbers(node, "height", [2.0], path)[0]) / 2
    side = [(radius, -half), (0.0, half)] if flag(node, "side", True) else []
    return _about_y(_profiles([(0.0, -half), (radius, -half)], side, [], node))


def _profiles(
    bottom: list[tuple[float, float]],
    side: list[tuple[float, float]],
    top: list[tuple[float, float]],
    node: Node,
) -> list[list[tuple[float, float]]]:
    kept = [
        bottom if flag(node, "bottom", True) else [],
        side,
        top if flag(node, "top", True) else [],
    ]
    return [profile for profile in kept if profile]


def _about_y(profiles: list[list[tuple[float, float]]]) -> Geometry:
    """Each profile turned about the y axis, smooth round it, sharp between profiles."""
    vertices, normals, triangles, count = [], [], [], 0
    for profile in profiles:
        points, faces = turned(profile, SEGMENTS)
        about_y = points[:, [1, 2, 0]]  # z to y: a cyclic change keeps the sense of the triangles
        some_vertices, some_normals, some_triangles = creased(about_y, faces, np.radians(60))
        vertices.append(some_vertices)
        normals.append(some_normals)
        triangles.append(some_triangles + count)
        count += len(some_vertices)
    if not vertices:
        return Geometry(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
    return Geometry(np.concatenate(vertices), np.concatenate(normals), np.concatenate(triangles))


GEOMETRY: Mapping[str, Callable[[Node, Path], Geometry]] = {
    "IndexedFaceSet": _indexed_face_set,
    "Box": _box,
    "Cone": _cone,
    "Cylinder": _cylinder,
    "Sphere": _sphere,
}
