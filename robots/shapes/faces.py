"""Conversion of polygon faces to triangles with one normal and colour per vertex, for a graphics card.

A face has any number of corners. Each corner refers by number to a point, and optionally to a normal
and a colour. Corners that share all three become one vertex.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robots.shapes.geometry import FloatArray, IndexArray, unit
from robots.shapes.normals import corner_keys, crease_normals
from robots.shapes.polygons import Effort, area_vectors, bent_inwards, ears, fans, starts_of


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of values, and the row number of each corner."""

    values: FloatArray
    chosen: IndexArray


@dataclass(frozen=True, eq=False)
class Faces:
    """Polygons.

    Attributes:
        points: (n, 3).
        corners: (c,) point numbers, face after face.
        sizes: (f,) corners of each face.
        normals: (m, 3) unit vectors by corner; None: computed from the faces.
        colors: (m, 3) by corner.
        ccw: Corners run counter-clockwise, seen from outside.
        solid: Only the outer side is drawn.
        convex: Every face is convex.
        crease: Faces that meet at a smaller angle [rad] are drawn as one smooth surface.
    """

    points: FloatArray
    corners: IndexArray
    sizes: IndexArray
    normals: Table | None = None
    colors: Table | None = None
    ccw: bool = True
    solid: bool = True
    convex: bool = True
    crease: float = 0.0


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles.

    Attributes:
        colors: (v, 3), or None.
        solid: Only the outer side is drawn.
        rough: Concave faces took too long to triangulate, so some triangles are outside their face.
    """

    vertices: FloatArray
    normals: FloatArray
    triangles: IndexArray
    colors: FloatArray | None = None
    solid: bool = True
    rough: bool = False


def kept_faces(faces: Faces, kept: NDArray[np.bool_]) -> Faces:
    """Return the faces for which the (f,) mask is true."""
    if kept.all():
        return faces
    corners = np.repeat(kept, faces.sizes)

    def table(one: Table | None) -> Table | None:
        return None if one is None else Table(one.values, one.chosen[corners])

    return replace(
        faces,
        corners=faces.corners[corners],
        sizes=faces.sizes[kept],
        normals=table(faces.normals),
        colors=table(faces.colors),
    )


def surface(faces: Faces, effort: Effort) -> Surface:
    """Return the triangles of the faces; faces with fewer than three corners are left out.

    Args:
        effort: Work budget for the concave faces of the whole file; reduced by this call.
    """
    faces = kept_faces(faces, faces.sizes >= 3)
    triangles, rough = _triangles(faces, effort)
    normals = _generated(faces) if faces.normals is None else faces.normals
    colors = faces.colors
    # Flat facets share no vertices. Otherwise corners with one point, normal and colour are merged.
    kept = np.arange(len(faces.corners))
    if faces.normals is not None or faces.crease > 0:
        kept, triangles = _joined(faces, normals, triangles)
    if not faces.ccw:
        triangles = triangles[:, ::-1]
    return Surface(
        vertices=faces.points[faces.corners[kept]],
        normals=normals.values[normals.chosen[kept]],
        triangles=triangles,
        colors=None if colors is None else colors.values[colors.chosen[kept]],
        solid=faces.solid,
        rough=rough,
    )


def _generated(faces: Faces) -> Table:
    """Compute normals for faces that have none."""
    owners = np.repeat(np.arange(len(faces.sizes)), faces.sizes)
    areas = area_vectors(faces.points, faces.corners, faces.sizes)
    areas = areas if faces.ccw else -areas
    if faces.crease <= 0:
        return Table(unit(areas), owners)
    by_corner = crease_normals(faces.corners, owners, areas, faces.crease)
    return Table(by_corner, np.arange(len(owners)))


def _triangles(faces: Faces, effort: Effort) -> tuple[IndexArray, bool]:
    """Return the (t, 3) corners of the triangles, and whether some are outside their face."""
    if not len(faces.sizes):
        return np.zeros((0, 3), dtype=np.int64), False
    triangles, _ = fans(faces.sizes)
    if faces.convex or not (faces.sizes > 3).any():
        return triangles, False
    many = np.flatnonzero(bent_inwards(faces.points, faces.corners, faces.sizes) & (faces.sizes > 3))
    starts = starts_of(faces.sizes)
    first = starts_of(faces.sizes - 2)
    effort.grant(int(faces.sizes[many].sum()))
    for face in many.tolist():
        if effort.spent:
            break  # The other faces remain fans.
        start, size = int(starts[face]), int(faces.sizes[face])
        cut = ears(faces.points[faces.corners[start : start + size]], effort)
        triangles[first[face] : first[face] + size - 2] = start + cut
    return triangles, len(many) > 0 and effort.spent


def _joined(faces: Faces, normals: Table, triangles: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Return the corners that become vertices, and the triangles as numbers of those vertices."""
    keys = corner_keys(faces.corners, normals.values[normals.chosen])
    if faces.colors is not None:
        # Number the keys first: a point, a normal and a colour do not fit into 64 bits.
        _, keys = np.unique(keys, return_inverse=True)
        keys = keys * len(faces.colors.values) + faces.colors.chosen
    _, kept, vertex = np.unique(keys, return_index=True, return_inverse=True)
    return kept, vertex[triangles].astype(np.int64)
