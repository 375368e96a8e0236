"""VRML's Extrusion: a cross-section moved along a spine.

Source: ISO/IEC 14772-1:1997, 6.18.
"""

import numpy as np

from robots.shapes.faces import Faces
from robots.shapes.files.vrml.parser import Node
from robots.shapes.files.vrml.values import flag, number, rotations, rows
from robots.shapes.geometry import FloatArray, unit
from robots.shapes.polygons import cross

_MOST_POINTS = 5_000_000
# Sine of an angle below which the spine counts as straight.
_STRAIGHT = 1e-9


def extrusion(node: Node) -> Faces:
    """Return the sides, as quadrilaterals, and the caps of an Extrusion.

    Raises:
        ShapeError: If it has millions of points.
    """
    spine = _rows(node, "spine", [[0, 0, 0], [0, 1, 0]])
    section = _rows(node, "crossSection", [[1, 1], [1, -1], [-1, -1], [-1, 1], [1, 1]])
    count, width = len(spine), len(section)
    if count < 2 or width < 2:
        node.warn(f"has {count} spine and {width} crossSection points, both need 2; not drawn")
        return Faces(np.zeros((0, 3)), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))
    if count * width > _MOST_POINTS:
        raise node.error(f"{count} x {width} points; at most {_MOST_POINTS} are drawn")
    points = _points(node, spine, section)
    # The last points of a closed curve are its first ones, so that the seam is smooth.
    numbers = np.arange(count * width).reshape(count, width)
    closed = bool((section[0] == section[-1]).all()) and width > 2
    if closed:
        numbers[:, -1] = numbers[:, 0]
    if count > 2 and np.array_equal(points[:width], points[-width:]):
        numbers[-1] = numbers[0]
    sides = np.stack([numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, 1:], numbers[1:, :-1]], axis=-1)
    rim = numbers[:, :-1] if closed else numbers
    caps = []
    # A closed spine has no ends; other readers draw no caps inside it either.
    ended = not (count > 2 and (spine[0] == spine[-1]).all())
    if ended and flag(node, "beginCap", True):
        caps.append(rim[0, ::-1])
    if ended and flag(node, "endCap", True):
        caps.append(rim[-1])
    return Faces(
        points,
        corners=np.concatenate([sides.ravel(), *caps]),
        sizes=np.array([4] * (sides.size // 4) + [len(cap) for cap in caps], dtype=np.int64),
        ccw=flag(node, "ccw", True),
        solid=flag(node, "solid", True),
        convex=flag(node, "convex", True),
        crease=number(node, "creaseAngle", 0.0),
    )


def _points(node: Node, spine: FloatArray, section: FloatArray) -> FloatArray:
    """Return the (n * w, 3) points: the cross-section at each point of the spine, scaled and rotated."""
    count = len(spine)
    scale = _at_each(node, _rows(node, "scale", [[1, 1]]), count, "scale")
    turns = rotations(_at_each(node, _rows(node, "orientation", [[0, 0, 1, 0]]), count, "orientation"))
    flat = np.zeros((count, len(section), 3))
    flat[:, :, [0, 2]] = section * scale[:, None]
    placed = section_planes(spine) @ turns
    points: FloatArray = (spine[:, None] + np.einsum("nij,nwj->nwi", placed, flat)).reshape(-1, 3)
    return points


def section_planes(spine: FloatArray) -> FloatArray:
    """Return the (n, 3, 3) spine-aligned cross-section plane (SCP) at each point: x, y and z as columns."""
    # Points that coincide have the same plane.
    different = np.ones(len(spine), dtype=bool)
    different[1:] = (np.diff(spine, axis=0) != 0).any(axis=1)
    path = spine[different]
    if len(path) < 2:
        return np.broadcast_to(np.eye(3), (len(spine), 3, 3))
    closed = len(path) > 2 and bool((path[0] == path[-1]).all())
    before, after = np.roll(path, 1, axis=0), np.roll(path, -1, axis=0)
    if closed:
        before[0], after[-1] = path[-2], path[1]
    else:
        before[0], after[-1] = path[0], path[-1]
    along = _carried(unit(after - before))
    ahead, behind = unit(after - path), unit(before - path)
    bends = cross(ahead, behind)
    bends[(np.abs(bends) < _STRAIGHT).all(axis=1)] = 0
    if not closed:
        bends[0] = bends[-1] = 0
    if not bends.any():
        planes = np.broadcast_to(_straight_plane(along[0]), (len(path), 3, 3))
    else:
        third = _carried(unit(bends))
        # The bend's axis flips where the spine bends to the other side; each flip applies to all that follow.
        turned = np.einsum("ij,ij->i", third[1:], third[:-1]) < 0
        third[1:] *= np.where(np.cumsum(turned) % 2, -1.0, 1.0)[:, None]
        if closed:
            third[-1] = third[0]
        planes = np.stack([unit(cross(along, third)), along, third], axis=-1)
    result: FloatArray = planes[np.cumsum(different) - 1]
    return result


def _carried(vectors: FloatArray) -> FloatArray:
    """Replace zero vectors by the one before, and at the beginning by the first that is not zero."""
    there = np.flatnonzero(vectors.any(axis=1))
    if not len(there):
        return vectors
    last = np.searchsorted(there, np.arange(len(vectors)), side="right") - 1
    carried: FloatArray = vectors[there[np.maximum(last, 0)]]
    return carried


def _straight_plane(along: FloatArray) -> FloatArray:
    """Return a straight spine's plane: the smallest rotation of the y axis onto the spine."""
    y = np.array([0.0, 1.0, 0.0])
    axis = np.cross(y, along)
    angle = np.arctan2(np.linalg.norm(axis), along[1])
    if not axis.any():
        axis = np.array([0.0, 0.0, 1.0])
    return rotations(np.array([*axis, angle]))


def _rows(node: Node, name: str, default: list[list[float]]) -> FloatArray:
    if name not in node.fields:
        return np.array(default, dtype=np.float64)
    return rows(node, name, len(default[0]))


def _at_each(node: Node, values: FloatArray, count: int, name: str) -> FloatArray:
    """Return (count, w) values, one for each spine point, by repeating the last or dropping extra ones."""
    if 1 < len(values) < count:
        node.warn(f"{name} has {len(values)} values for {count} spine points; the last is repeated")
    if not len(values):
        raise node.error(f"{name} is empty; it takes one value, or one for each spine point")
    return values[np.minimum(np.arange(count), len(values) - 1)]
