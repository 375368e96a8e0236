"""Content of a shape file in any format: triangles, lines and points with materials.

Coordinates are in the file's units and axes.
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
_NO_ROTATION = np.eye(3)
# (4, 4): x stays, y becomes z.
Y_UP_TO_Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


@dataclass(frozen=True)
class Material:
    """A surface; colours are sRGB, each number 0 to 1.

    Attributes:
        name: Name in the file; a robot description's colour replaces the material "paint".
        transparency: 0 opaque, 1 invisible.
        texture: Name of the texture image; the image is not drawn.
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
        two_sided: Both sides are drawn.
        colors: (v, 4) sRGB and opacity, 0 to 1, instead of the material's; None: the material's.
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
        colors: (v, 4) sRGB and opacity, 0 to 1, instead of the material's; None: the material's.
    """

    name: str
    material: Material
    vertices: FloatArray
    segments: IndexArray
    colors: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Node:
    """A pivot in a file's hierarchy, about which parts turn; the parts' vertices are already in place.

    Attributes:
        name: Parts with this name move with the node.
        parent: Number of the parent node; -1 for none.
        node_to_file: (4, 4); its origin is the pivot.
    """

    name: str
    parent: int
    node_to_file: FloatArray


@dataclass(frozen=True, eq=False)
class Geometry:
    """The whole content of a shape file.

    Attributes:
        wires: Lines and points; triangle counts and bounds do not include them.
        warnings: Irregularities that the reader could handle, a sentence each.
        missing: Names, as in the file, of other files that do not exist; the shape is drawn without them.
        files: Other files that the reader looked for, existing or not: the content depends on them.
        nodes: Hierarchy, if the format has one that adds to the parts (3DS).
        unit_m: Length of the unit [m] that the file or its format states; None if neither does.
        up: Upward axis, "y" or "z", that the file or its format states; empty if neither does.
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
        """Total number of triangles."""
        return sum(len(part.triangles) for part in self.parts)


def welded(vertices: FloatArray, triangles: IndexArray) -> tuple[FloatArray, IndexArray]:
    """Merge vertices that have the same position, which smoothing needs; every triangle is kept.

    Returns:
        Vertices (w, 3) and triangles (t, 3).
    """
    positions = np.ascontiguousarray(vertices + 0.0)  # turns -0 into 0
    bits = positions.view(np.uint64)
    # Sorting one hash per vertex takes a tenth of the time of sorting three numbers; hashes may collide.
    keys = (bits * _MIXERS[: bits.shape[1]]).sum(axis=1)
    keys ^= keys >> np.uint64(29)
    _, kept, number = np.unique(keys, return_index=True, return_inverse=True)
    if not np.array_equal(positions[kept][number], positions):
        _, kept, number = np.unique(positions, axis=0, return_index=True, return_inverse=True)
    return positions[kept], number.reshape(-1)[triangles].astype(np.int64)


def bounds(geometry: Geometry) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper corner, (3,) each, of the vertices in triangles; zeros if there are none."""
    used = [part.vertices[np.unique(part.triangles)] for part in geometry.parts if len(part.triangles)]
    if not used:
        return np.zeros(3), np.zeros(3)
    vertices = np.concatenate(used)
    return vertices.min(axis=0), vertices.max(axis=0)


def placed(wire: Wire, placement: FloatArray) -> Wire:
    """Return a wire moved by a (4, 4) affine transform."""
    return replace(wire, vertices=wire.vertices @ placement[:3, :3].T + placement[:3, 3])


def transformed(part: Part, placement: FloatArray) -> Part:
    """Return a part moved by a (4, 4) affine transform; a mirroring one reverses the triangles' winding."""
    linear = placement[:3, :3]
    if (linear == _NO_ROTATION).all():  # large files have thousands of parts that are only shifted
        return replace(part, vertices=part.vertices + placement[:3, 3])
    triangles = part.triangles[:, ::-1] if np.linalg.det(linear) < 0 else part.triangles
    return replace(
        part,
        vertices=part.vertices @ linear.T + placement[:3, 3],
        normals=unit(part.normals @ normal_transform(linear).T),
        triangles=triangles,
    )


def transformed_geometry(geometry: Geometry, placement: FloatArray) -> Geometry:
    """Return a shape with its wires and nodes moved by a (4, 4) affine transform."""
    return replace(
        geometry,
        parts=tuple(transformed(part, placement) for part in geometry.parts),
        wires=tuple(placed(wire, placement) for wire in geometry.wires),
        nodes=tuple(replace(node, node_to_file=placement @ node.node_to_file) for node in geometry.nodes),
    )


def normal_transform(linear: FloatArray) -> FloatArray:
    """Return the cofactor matrix: parallel to the inverse transpose, but defined for singular matrices."""
    one, other = linear[[1, 2, 0]], linear[[2, 0, 1]]
    # Not numpy.cross, which is slow for files with thousands of parts.
    cofactors = one[:, [1, 2, 0]] * other[:, [2, 0, 1]] - one[:, [2, 0, 1]] * other[:, [1, 2, 0]]
    return cofactors if np.linalg.det(linear) >= 0 else -cofactors


def unit(vectors: FloatArray) -> FloatArray:
    """Return (n, 3) vectors scaled to length one; zero vectors and those of infinite length become zero."""
    with np.errstate(over="ignore", invalid="ignore"):
        lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    measured = (lengths > 0) & np.isfinite(lengths)
    result: FloatArray = np.divide(vectors, lengths, out=np.zeros_like(vectors), where=measured)
    return result
