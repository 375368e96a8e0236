"""The values of a node's fields, as what they should be; a wrong one is an error with its place."""

from collections.abc import Sequence
from typing import cast

import numpy as np

from robots.meshes.mesh import Color, FloatArray, IndexArray
from robots.meshes.vrml.parser import Node


def numbers(node: Node, name: str, default: Sequence[float], count: int | None = None) -> FloatArray:
    """A field's numbers, `count` of them where it is given."""
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
    """A field's one number."""
    return float(numbers(node, name, [], 1)[0]) if name in node.fields else default


def rows(node: Node | None, name: str, width: int) -> FloatArray:
    """(n, width) of a list such as Coordinate's point; (0, width) without it."""
    if node is None:
        return np.zeros((0, width))
    flat = numbers(node, name, [])
    if len(flat) % width:
        raise node.error(f"{name} has {len(flat)} numbers, which do not make rows of {width}")
    return flat.reshape(-1, width)


def indices(node: Node, name: str) -> IndexArray:
    """A list of whole numbers; any below 0 is an end."""
    flat = numbers(node, name, [])
    if len(flat) and np.abs(flat).max() >= 2**53:
        raise node.error(f"{name} holds {np.abs(flat).max():g}; it takes numbers of points")
    found = flat.astype(np.int64)
    wrong = found != flat
    if wrong.any():
        raise node.error(f"{name} holds {flat[int(np.argmax(wrong))]:g}; it takes whole numbers")
    return found


def color(node: Node, name: str, default: Color) -> Color:
    """A colour, each part brought into 0 to 1."""
    if name not in node.fields:
        return default
    red, green, blue = (min(max(part, 0.0), 1.0) for part in numbers(node, name, default, 3).tolist())
    return red, green, blue


def flag(node: Node, name: str, default: bool) -> bool:
    """TRUE or FALSE; anything else counts as the default."""
    value = node.fields.get(name)
    return value if isinstance(value, bool) else default


def strings(node: Node, name: str) -> list[str]:
    """A field's strings."""
    value = node.fields.get(name)
    return cast(list[str], value) if _is_list_of(value, str) else []


def nodes_of(node: Node, name: str) -> list[Node]:
    """A field's nodes."""
    value = node.fields.get(name)
    return cast(list[Node], value) if _is_list_of(value, Node) else []


def _is_list_of(value: object, kind: type) -> bool:
    """A list is all of one kind, so its first entry tells; each use of a long one looks at no more."""
    return isinstance(value, list) and len(value) > 0 and isinstance(value[0], kind)
