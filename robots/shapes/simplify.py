"""Reduction of a shape to a number of triangles that is enough for display."""

import importlib
from dataclasses import replace
from typing import Any

import numpy as np

from robots.shapes.geometry import Geometry, Part, welded
from robots.shapes.normals import creased

_CREASE = np.radians(30)
# Smaller parts are not reduced: a screw needs its few triangles.
_LEAST = 64


def lightened(geometry: Geometry, most: int) -> Geometry:
    """Return the shape reduced to about `most` triangles, or unchanged if it has no more."""
    count = geometry.triangle_count
    if count <= most:
        return geometry
    return replace(geometry, parts=tuple(_light(part, most / count) for part in geometry.parts))


def _light(part: Part, kept: float) -> Part:
    if len(part.triangles) < _LEAST:
        return part
    library: Any = importlib.import_module("fast_simplification")
    vertices, triangles = welded(part.vertices, part.triangles)
    points, faces, collapses = library.simplify(
        vertices.astype(np.float32),
        triangles.astype(np.int32),
        target_reduction=1 - kept,
        return_collapses=True,
    )
    if part.colors is None:
        made = creased(points.astype(np.float64), faces.astype(np.int64), _CREASE)
        return replace(part, vertices=made[0], normals=made[1], triangles=made[2])
    # Each new vertex has the colour of the first old vertex that was merged into it.
    points, faces, became = library.replay_simplification(
        vertices.astype(np.float32), triangles.astype(np.int32), collapses
    )
    at_welded = np.zeros((len(vertices), 4))
    at_welded[triangles.ravel()] = part.colors[part.triangles.ravel()]
    colors = np.ones((len(points), 4))
    colors[became[::-1]] = at_welded[::-1]
    placed, normals, cut = creased(points.astype(np.float64), faces.astype(np.int64), _CREASE)
    return replace(
        part,
        vertices=placed[cut.ravel()],
        normals=normals[cut.ravel()],
        triangles=np.arange(cut.size, dtype=np.int64).reshape(-1, 3),
        colors=colors[faces.ravel().astype(np.int64)],
    )
