"""The values of a node's fields, as what they should be; a wrong one is an error with its line."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from robots.errors import MeshError
from robots.meshes.mesh import Color, FloatArray, IndexArray
from robots.meshes.vrml_parser import Node


def numbers(
    node: Node, name: str, default: Sequence[float], path: Path, count: int | None = None
) -> FloatArray:
    """A field's numbers, `count` of them where it is given."""
    value = node.fields.get(name)
    if value is None:
        return np.array(default, dtype=np.float64)
    if isinstance(value, list) and not value:  # "[ ]": an empty list shows no type
        value = np.zeros(0)
    if not isinstance(value, np.ndarray):
        raise line_error(path, node, f"{name} must be numbers")
    wanted = count if count is not None else len(default) if len(default) == 1 else None
    if wanted is not None and len(value) != wanted:
        raise line_error(path, node, f"{name} has {len(value)} numbers; it takes {wanted}")
    return value


def rows(node: Node | None, name: str, width: int, path: Path) -> FloatArray:
    """(n, width) of a list such as Coordinate's point; (0, width) without it."""
    if node is None or name not in node.fields:
        return np.zeros((0, width))
    flat = numbers(node, name, [], path)
    if len(flat) % width:
        raise line_error(path, node, f"{name} has {len(flat)} numbers, which do not make rows of {width}")
    return flat.reshape(-1, width)


def indices(node: Node, name: str, count: int, path: Path) -> IndexArray:
    """An index list; each is -1 or below `count`."""
    flat = numbers(node, name, [], path)
    found = flat.astype(np.int64)
    wrong = (found != flat) | (found < -1) | (found >= count)
    if wrong.any():
        value = flat[int(np.argmax(wrong))]
        raise line_error(path, node, f"{name} holds {value:g}; there are {count}: 0 to {count - 1}, or -1")
    return found


def color(node: Node, name: str, default: Color, path: Path) -> Color:
    """A colour, each part brought into 0 to 1."""
    red, green, blue = np.clip(numbers(node, name, default, path, 3), 0.0, 1.0).tolist()
    return red, green, blue


def flag(node: Node, name: str, default: bool) -> bool:
    """TRUE or FALSE; anything else counts as the default."""
    value = node.fields.get(name)
    return value if isinstance(value, bool) else default


def strings(node: Node, name: str) -> list[str]:
    """A field's strings."""
    value = node.fields.get(name)
    return [entry for entry in value if isinstance(entry, str)] if isinstance(value, list) else []


def nodes_of(node: Node, name: str) -> list[Node]:
    """A field's nodes."""
    value = node.fields.get(name)
    return [entry for entry in value if isinstance(entry, Node)] if isinstance(value, list) else []


def node_of(node: Node, name: str) -> Node | None:
    """A field's one node."""
    found = nodes_of(node, name)
    return found[0] if found else None


def line_error(path: Path, node: Node, reason: str) -> MeshError:
    """An error in a node, with its line and type."""
    return MeshError(path, f"{node.type}: {reason}", place=f"line {node.line}")
