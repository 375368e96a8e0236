"""Triangles of VRML 2.0 geometry nodes.

Source: ISO/IEC 14772-1:1997, clause 6 (the clause of each node).
"""

from collections.abc import Callable, Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from robots.shapes.faces import Faces, Surface, Table, kept_faces, surface
from robots.shapes.files.vrml.extrusion import extrusion
from robots.shapes.files.vrml.parser import Node
from robots.shapes.files.vrml.protos import node_of
from robots.shapes.files.vrml.values import flag, indices, number, numbers, rows
from robots.shapes.geometry import FloatArray, IndexArray, unit
from robots.shapes.normals import creased
from robots.shapes.polygons import Effort
from robots.shapes.solids import ball, box, turned

SEGMENTS = 32


def _indexed_face_set(node: Node, effort: Effort) -> Surface:
    points = rows(node_of(node, "coord"), "point", 3)
    listed = indices(node, "coordIndex")
    placed, sizes = runs(listed)
    faces = Faces(
        points,
        corners=listed[placed],
        sizes=sizes,
        normals=_by_corner(node, "normal", placed, sizes, listed),
        colors=_by_corner(node, "color", placed, sizes, listed),
        ccw=flag(node, "ccw", True),
        solid=flag(node, "solid", True),
        convex=flag(node, "convex", True),
        crease=number(node, "creaseAngle", 0.0),
    )
    wrong = faces.corners >= len(points)
    if wrong.any():
        owners = np.repeat(np.arange(len(sizes)), sizes)
        kept = np.bincount(owners, weights=wrong, minlength=len(sizes)) == 0
        node.warn(
            f"coordIndex contains {faces.corners[wrong][0]}; there are {len(points)} points, 0 to "
            f"{len(points) - 1}: {np.count_nonzero(~kept)} faces are left out"
        )
        faces = kept_faces(faces, kept)
    return surface(faces, effort)


def runs(listed: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Split an index list into runs that end with -1; the last run may lack its end.

    Returns:
        Positions in the list of the numbers that are no end, and the length of each run.
    """
    ended = listed < 0
    placed = np.flatnonzero(~ended)
    sizes = np.bincount(np.cumsum(ended)[placed], minlength=int(ended.sum()))
    return placed, sizes.astype(np.int64)


def _by_corner(
    node: Node, name: str, placed: IndexArray, sizes: IndexArray, listed: IndexArray
) -> Table | None:
    """Return the normal or colour of each corner, by the rules of 6.23; None if the node has none."""
    values = table_of(node, name)
    if not len(values):
        return None
    given = indices(node, f"{name}Index")
    if flag(node, f"{name}PerVertex", True):
        if len(given) and len(given) <= int(placed.max(initial=-1)):
            node.warn(f"{name}Index is shorter than coordIndex; {name} is ignored")
            return None
        chosen = (given if len(given) else listed)[placed]
    else:
        faces = given[given >= 0] if len(given) else np.arange(len(sizes))
        if len(faces) < len(sizes):
            node.warn(f"{name}Index has {len(faces)} numbers for {len(sizes)} faces; {name} is ignored")
            return None
        chosen = np.repeat(faces[: len(sizes)], sizes)
    return checked(node, name, values, chosen)


def table_of(node: Node, name: str) -> FloatArray:
    """Return (n, 3) unit vectors of the Normal node in `normal`, or colours of the Color node in `color`."""
    if name == "normal":
        return unit(rows(node_of(node, "normal"), "vector", 3))
    return np.clip(rows(node_of(node, "color"), "color", 3), 0.0, 1.0)


def checked(node: Node, name: str, values: FloatArray, chosen: IndexArray) -> Table | None:
    """Return a table, or None with a warning if a chosen number is out of range."""
    wrong: NDArray[np.bool_] = (chosen < 0) | (chosen >= len(values))
    if wrong.any():
        node.warn(f"{name} number {chosen[wrong][0]}; there are {len(values)}: {name} is ignored")
        return None
    return Table(values, chosen)


def _elevation_grid(node: Node, effort: Effort) -> Surface:
    """Return the surface of heights above a grid in x and z; each square of the grid is a face (6.17)."""
    columns, lines = int(number(node, "xDimension", 0)), int(number(node, "zDimension", 0))
    heights = numbers(node, "height", [])
    if columns < 0 or lines < 0 or columns * lines > len(heights):
        raise node.error(f"height has {len(heights)} numbers; {columns} x {lines} are needed")
    across, along = np.arange(columns), np.arange(lines)
    z, x = np.meshgrid(
        along * number(node, "zSpacing", 1.0), across * number(node, "xSpacing", 1.0), indexing="ij"
    )
    points = np.column_stack([x.ravel(), heights[: columns * lines], z.ravel()])
    first = (along[:-1, None] * columns + across[None, :-1]).ravel()
    corners = np.column_stack([first, first + columns, first + columns + 1, first + 1]).astype(np.int64)

    def table(name: str) -> Table | None:
        values = table_of(node, name)
        if not len(values):
            return None
        by_face = np.repeat(np.arange(len(first)), 4)
        return checked(
            node, name, values, corners.ravel() if flag(node, f"{name}PerVertex", True) else by_face
        )

    return surface(
        Faces(
            points,
            corners.ravel(),
            np.full(len(first), 4),
            normals=table("normal"),
            colors=table("color"),
            ccw=flag(node, "ccw", True),
            solid=flag(node, "solid", True),
            crease=number(node, "creaseAngle", 0.0),
        ),
        effort,
    )


def _extrusion(node: Node, effort: Effort) -> Surface:
    return surface(extrusion(node), effort)


def _box(node: Node, _: Effort) -> Surface:
    x, y, z = numbers(node, "size", [2.0, 2.0, 2.0], 3) / 2
    return _stretched(_unit_box(), node, x, y, z)


def _sphere(node: Node, _: Effort) -> Surface:
    radius = number(node, "radius", 1.0)
    return _stretched(_unit_ball(), node, radius, radius, radius)


def _cylinder(node: Node, _: Effort) -> Surface:
    radius, height = number(node, "radius", 1.0), number(node, "height", 2.0)
    kept = tuple(flag(node, name, True) for name in ("bottom", "side", "top"))
    return _stretched(_unit_turned(1.0, kept), node, radius, height / 2, radius)


def _cone(node: Node, _: Effort) -> Surface:
    radius, height = number(node, "bottomRadius", 1.0), number(node, "height", 2.0)
    kept = (flag(node, "bottom", True), flag(node, "side", True), False)
    return _stretched(_unit_turned(0.0, kept), node, radius, height / 2, radius)


def _stretched(one: Surface, node: Node, x: float, y: float, z: float) -> Surface:
    stretch = np.array([x, y, z])
    if (stretch <= 0).any():
        node.warn(f"a size is {stretch.min():g}; it must be above 0")
        stretch = np.abs(stretch)
    # The cofactors are defined for a size of 0 too.
    normals = unit(one.normals * stretch[[1, 2, 0]] * stretch[[2, 0, 1]])
    return Surface(one.vertices * stretch, normals, one.triangles)


@cache
def _unit_box() -> Surface:
    return Surface(*creased(*box(-np.ones(3), np.ones(3)), 0.0))


@cache
def _unit_ball() -> Surface:
    vertices, triangles = ball(1.0, SEGMENTS)
    return Surface(*creased(vertices[:, [1, 2, 0]], triangles, np.pi))


@cache
def _unit_turned(top_radius: float, kept: tuple[bool, ...]) -> Surface:
    """Return the kept ones of bottom, side and top of a cylinder about y from -1 to 1; radius 0: a cone."""
    profiles = [
        [(0.0, -1.0), (1.0, -1.0)],
        [(1.0, -1.0), (top_radius, 1.0)],
        [(top_radius, 1.0), (0.0, 1.0)],
    ]
    vertices, normals, triangles, count = [np.zeros((0, 3))], [np.zeros((0, 3))], [], 0
    for profile, wanted in zip(profiles, kept, strict=True):
        if not wanted:
            continue
        points, faces = turned(profile, SEGMENTS)
        about_y = points[:, [1, 2, 0]]  # z to y: a cyclic permutation keeps the winding
        # Smooth around the axis, sharp between the profiles.
        some_vertices, some_normals, some_triangles = creased(about_y, faces, np.radians(60))
        vertices.append(some_vertices)
        normals.append(some_normals)
        triangles.append(some_triangles + count)
        count += len(some_vertices)
    faces = np.concatenate([np.zeros((0, 3), dtype=np.int64), *triangles])
    return Surface(np.concatenate(vertices), np.concatenate(normals), faces)


GEOMETRY: Mapping[str, Callable[[Node, Effort], Surface]] = {
    "Box": _box,
    "Cone": _cone,
    "Cylinder": _cylinder,
    "ElevationGrid": _elevation_grid,
    "Extrusion": _extrusion,
    "IndexedFaceSet": _indexed_face_set,
    "Sphere": _sphere,
}
