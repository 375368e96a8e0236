"""Lines and points of VRML's IndexedLineSet and PointSet, with their colours.

Source: ISO/IEC 14772-1:1997, 6.24 and 6.36.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from robots.shapes.faces import Table
from robots.shapes.files.vrml.geometry import checked, runs, table_of
from robots.shapes.files.vrml.parser import Node
from robots.shapes.files.vrml.protos import node_of
from robots.shapes.files.vrml.values import flag, indices, rows
from robots.shapes.geometry import FloatArray, IndexArray


@dataclass(frozen=True, eq=False)
class Strokes:
    """Lines, or points.

    Attributes:
        segments: (s, 2) vertex numbers of lines; if empty, the vertices are points.
        colors: (v, 3), or None.
    """

    vertices: FloatArray
    segments: IndexArray
    colors: FloatArray | None = None


def _indexed_line_set(node: Node) -> Strokes:
    points = rows(node_of(node, "coord"), "point", 3)
    listed = indices(node, "coordIndex")
    placed, sizes = runs(listed)
    corners, owners = listed[placed], np.repeat(np.arange(len(sizes)), sizes)
    table = _line_colors(node, listed, placed, owners)
    # Each corner joins the next one of its own line.
    segments = np.flatnonzero(owners[1:] == owners[:-1])[:, None] + np.array([0, 1])
    wrong = corners >= len(points)
    if wrong.any():
        node.warn(
            f"coordIndex contains {corners[wrong][0]}; there are {len(points)} points, 0 to "
            f"{len(points) - 1}: the lines to it are left out"
        )
        segments = segments[~wrong[segments].any(axis=1)]
        corners = np.where(wrong, 0, corners)
    if not len(segments):
        return Strokes(np.zeros((0, 3)), np.zeros((0, 2), dtype=np.int64))
    colors = None if table is None else table.values[table.chosen]
    return Strokes(points[corners], segments.astype(np.int64), colors)


def _line_colors(node: Node, listed: IndexArray, placed: IndexArray, owners: IndexArray) -> Table | None:
    colors = table_of(node, "color")
    if not len(colors):
        return None
    given = indices(node, "colorIndex")
    if flag(node, "colorPerVertex", True):
        if len(given) and len(given) <= int(placed.max(initial=-1)):
            node.warn("colorIndex is shorter than coordIndex; color is ignored")
            return None
        return checked(node, "color", colors, (given if len(given) else listed)[placed])
    lines = given[given >= 0] if len(given) else np.arange(int(owners.max(initial=-1)) + 1)
    if len(lines) <= int(owners.max(initial=-1)):
        node.warn(f"colorIndex has {len(lines)} numbers, fewer than there are lines; color is ignored")
        return None
    return checked(node, "color", colors, lines[owners])


def _point_set(node: Node) -> Strokes:
    points = rows(node_of(node, "coord"), "point", 3)
    colors = table_of(node, "color")
    none = np.zeros((0, 2), dtype=np.int64)
    if len(colors) and len(colors) < len(points):
        node.warn(f"{len(colors)} colors for {len(points)} points; color is ignored")
    return Strokes(points, none, colors[: len(points)] if len(colors) >= len(points) > 0 else None)


STROKES: Mapping[str, Callable[[Node], Strokes]] = {
    "IndexedLineSet": _indexed_line_set,
    "PointSet": _point_set,
}
