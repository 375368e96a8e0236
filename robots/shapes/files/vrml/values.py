"""Typed access to the fields of a node; a value of a wrong type is an error with its place."""

from collections.abc import Sequence
from typing import cast

import numpy as np

from robots.schema.poses import axis_rotation
from robots.shapes.files.vrml.parser import Node
from robots.shapes.geometry import Color, FloatArray, IndexArray


def numbers(node: Node, name: str, default: Sequence[float], count: int | None = None) -> FloatArray:
    """Return a field's numbers.

    Raises:
        ShapeError: If they are not numbers, or not `count` of them.
    """
    value = node.fields.get(name)
    if value is None:
        return np.array(default, dtype=np.float64)
    if isinstance(value, list) and not value:  # "[ ]": an empty list shows no type
        value = np.zeros(0)
    if not isinstance(value, np.ndarray):
        raise node.error(f"{name} must be numbers")
    if count is not None and len(value) != count:
        raise node.error(f"{name} has {len(value)} numbers; it takes {count}")
    return value


def number(node: Node, name: str, default: float) -> float:
    """Return a field's single number."""
    return float(numbers(node, name, [], 1)[0]) if name in node.fields else default


def rows(node: Node | None, name: str, width: int) -> FloatArray:
    """Return a list, such as Coordinate's point, as (n, width); (0, width) without a node."""
    if node is None:
        return np.zeros((0, width))
    flat = numbers(node, name, [])
    if len(flat) % width:
        raise node.error(f"{name} has {len(flat)} numbers, which do not make rows of {width}")
    return flat.reshape(-1, width)


def indices(node: Node, name: str) -> IndexArray:
    """Return a list of integers; negative ones mark ends."""
    flat = numbers(node, name, [])
    if len(flat) and np.abs(flat).max() >= 2**53:
        raise node.error(f"{name} contains {np.abs(flat).max():g}; it takes point numbers")
    found = flat.astype(np.int64)
    wrong = found != flat
    if wrong.any():
        raise node.error(f"{name} contains {flat[int(np.argmax(wrong))]:g}; it takes whole numbers")
    return found


def color(node: Node, name: str, default: Color) -> Color:
    """Return a colour, with each component clipped to 0 to 1."""
    if name not in node.fields:
        return default
    red, green, blue = (min(max(part, 0.0), 1.0) for part in numbers(node, name, default, 3).tolist())
    return red, green, blue


def flag(node: Node, name: str, default: bool) -> bool:
    """Return a boolean; the default for any other value."""
    value = node.fields.get(name)
    return value if isinstance(value, bool) else default


def strings(node: Node, name: str) -> list[str]:
    """Return a field's strings."""
    value = node.fields.get(name)
    return cast(list[str], value) if _is_list_of(value, str) else []


def nodes_of(node: Node, name: str) -> list[Node]:
    """Return a field's nodes."""
    value = node.fields.get(name)
    return cast(list[Node], value) if _is_list_of(value, Node) else []


def transform_matrix(node: Node) -> FloatArray:
    """Return the (4, 4) matrix of a Transform: `T C R SR S -SR -C` (6.52)."""
    given = node.fields
    matrix = np.eye(4)
    linear = matrix[:3, :3]
    if "scale" in given:
        linear *= numbers(node, "scale", [1, 1, 1], 3)
        if "scaleOrientation" in given:
            stretch = rotations(numbers(node, "scaleOrientation", [0, 0, 1, 0], 4))
            linear[:] = stretch @ linear @ stretch.T
    if "rotation" in given:
        linear[:] = rotations(numbers(node, "rotation", [0, 0, 1, 0], 4)) @ linear
    if "center" in given:
        center = numbers(node, "center", [0, 0, 0], 3)
        matrix[:3, 3] = center - linear @ center
    if "translation" in given:
        matrix[:3, 3] += numbers(node, "translation", [0, 0, 0], 3)
    return matrix


def rotations(axis_angles: FloatArray) -> FloatArray:
    """Return (..., 3, 3) rotations from (..., 4) axes of any length and angles [rad]; axis 0: no rotation."""
    return axis_rotation(axis_angles[..., :3], axis_angles[..., 3])


def _is_list_of(value: object, kind: type) -> bool:
    """Return whether a value is a non-empty list of this type.

    Lists have one type, so checking the first entry is enough, and fast for long lists.
    """
    return isinstance(value, list) and len(value) > 0 and isinstance(value[0], kind)
