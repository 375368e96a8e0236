"""What a mesh file holds, whatever its format: painted triangles, lines and points.

All in the file's own units and axes.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]
Color = tuple[float, float, float]

PAINT = "paint"
_MIXERS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)
_STILL = np.eye(3)


@dataclass(frozen=True)
class Material:
    """A surface; colours are sRGB, each number 0 to 1.

    Attributes:
        name: In the file; "paint" is what a description's colour replaces.
        transparency: 0 opaque, 1 not to be seen.
        texture: Name of the image that the file puts on it; kept by name, not drawn.
    """

    name: str = ""
    diffuse: Color = (0.8, 0.8, 0.8)
    specular: Color = (0.0, 0.0, 0.0)
    emissive: Color = (0.0, 0.0, 0.0)
    shininess: float = 0.2
    transparency: float = 0.0
    texture: str = ""


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one material.

    Attributes:
        vertices: (v, 3).
        normals: (v, 3) unit vectors, outwards.
        triangles: (t, 3) vertex numbers, counter-clockwise seen from outside.
        two_sided: Both faces are to be drawn.
        colors: (v, 4) sRGB and opacity, 0 to 1, instead of the material's; none: the material's.
    """

    name: str
    material: Material
    vertices: FloatArray
    normals: FloatArray
    triangles: IndexArray
    two_sided: bool = False
    colors: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Wire:
    """Lines or points of one material.

    Attributes:
        vertices: (v, 3).
        segments: (s, 2) vertex numbers; (0, 2) for points.
        colors: (v, 4) sRGB and opacity, 0 to 1, instead of the material's; none: the material's.
    """

    name: str
    material: Material
    vertices: FloatArray
    segments: IndexArray
    colors: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Node:
    """A place in a file's hierarchy that parts turn about; the parts themselves stand where they are drawn.

    Attributes:
        name: Its own; parts of this name move with it.
        parent: Number of the node that carries it; -1 for none.
        node_to_file: (4, 4); its origin is the pivot.
    """

    name: str
    parent: int
    node_to_file: FloatArray


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh file's whole content.

    Attributes:
        wires: Its lines and points; they count as no triangles and in no bounds.
        warnings: What the reader found odd but could read, a sentence each.
        missing: Files that it names and that are not there, as it names them; drawn without.
        files: The other files that its reader looked for, there or not: its content is theirs too.
        nodes: Its hierarchy, where the format has one that says more than the parts do (3DS).
        unit_m: Length of its unit [m] as the file, or its format, states it; none: it does not.
        up: Its upward axis as the file, or its format, states it, "y" or "z"; empty: it does not.
    """

    parts: tuple[Part, ...] = ()
    wires: tuple[Wire, ...] = ()
    warnings: tuple[str, ...] = field(default=())
    missing: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()
    nodes: tuple[Node, ...] = ()
    unit_m: float | None = None
    up: str = ""

    @property
    def triangle_count(self) -> int:
        """Number of triangles of all parts."""
        return sum(len(part.triangles) for part in self.parts)


def welded(vertices: FloatArray, triangles: IndexArray) -> tuple[FloatArray, IndexArray]:
    """Vertices at one place made one, as smoothing needs it; every triangle is kept."""
    places = np.ascontiguousarray(vertices + 0.0)  # -0 is 0
    bits = places.view(np.uint64)
    # Sorting one number a vertex takes a tenth of sorting three; two places may share it.
    keys = (bits * _MIXERS[: bits.shape[1]]).sum(axis=1)
    keys ^= keys >> np.uint64(29)
    _, kept, number = np.unique(keys, return_index=True, return_inverse=True)
    if not np.array_equal(places[kept][number], places):
        _, kept, number = np.unique(places, axis=0, return_index=True, return_inverse=True)
    return places[kept], number.reshape(-1)[triangles].astype(np.int64)


def bounds(mesh: Mesh) -> tuple[FloatArray, FloatArray]:
    """Least and greatest corner, (3,) each, of the vertices that triangles use; zeros for an empty mesh."""
    used = [part.vertices[np.unique(part.triangles)] for part in mesh.parts if len(part.triangles)]
    if not used:
        return np.zeros(3), np.zeros(3)
    vertices = np.concatenate(used)
    return vertices.min(axis=0), vertices.max(axis=0)


def placed(wire: Wire, placement: FloatArray) -> Wire:
    """A wire moved by a (4, 4) affine transform."""
    return replace(wire, vertices=wire.vertices @ placement[:3, :3].T + placement[:3, 3])


def transformed(part: Part, placement: FloatArray) -> Part:
    """A part moved by a (4, 4) affine transform; a mirroring one turns the triangles over."""
    linear = placement[:3, :3]
    if (linear == _STILL).all():  # many of many thousands of parts are only shifted
        return replace(part, vertices=part.vertices + placement[:3, 3])
    triangles = part.triangles[:, ::-1] if np.linalg.det(linear) < 0 else part.triangles
    return replace(
        part,
        vertices=part.vertices @ linear.T + placement[:3, 3],
        normals=unit(part.normals @ _normal_transform(linear).T),
        triangles=triangles,
    )


def transformed_mesh(mesh: Mesh, placement: FloatArray) -> Mesh:
    """A whole mesh, wires and nodes too, moved by a (4, 4) affine transform."""
    return replace(
        mesh,
        parts=tuple(transformed(part, placement) for part in mesh.parts),
        wires=tuple(placed(wire, placement) for wire in mesh.wires),
        nodes=tuple(replace(node, node_to_file=placement @ node.node_to_file) for node in mesh.nodes),
    )


def _normal_transform(linear: FloatArray) -> FloatArray:
    """The cofactors: as the inverse transpose, but for its length, and there for singular matrices too."""
    one, other = linear[[1, 2, 0]], linear[[2, 0, 1]]
    # Rows crossed with rows, without numpy.cross: it is slow for files of thousands of parts.
    cofactors = one[:, [1, 2, 0]] * other[:, [2, 0, 1]] - one[:, [2, 0, 1]] * other[:, [1, 2, 0]]
    return cofactors if np.linalg.det(linear) >= 0 else -cofactors


def unit(vectors: FloatArray) -> FloatArray:
    """(n, 3) vectors at length one; zero, and what is too long to measure, becomes zero."""
    with np.errstate(over="ignore", invalid="ignore"):
        lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    measured = (lengths > 0) & np.isfinite(lengths)
    result: FloatArray = np.divide(vectors, lengths, out=np.zeros_like(vectors), where=measured)
    return result
