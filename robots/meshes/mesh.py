"""What a mesh file holds, whatever its format: painted triangles in the file's own units and axes."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]
Color = tuple[float, float, float]

PAINT = "paint"


@dataclass(frozen=True)
class Material:
    """A surface; colours are sRGB, each number 0 to 1.

    Attributes:
        name: In the file; "paint" is what a description's colour replaces.
        transparency: 0 opaque, 1 not to be seen.
    """

    name: str = ""
    diffuse: Color = (0.8, 0.8, 0.8)
    specular: Color = (0.0, 0.0, 0.0)
    emissive: Color = (0.0, 0.0, 0.0)
    shininess: float = 0.2
    transparency: float = 0.0


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one material.

    Attributes:
        vertices: (v, 3).
        normals: (v, 3) unit vectors, outwards.
        triangles: (t, 3) vertex numbers, counter-clockwise seen from outside.
        two_sided: Both faces are to be drawn.
    """

    name: str
    material: Material
    vertices: FloatArray
    normals: FloatArray
    triangles: IndexArray
    two_sided: bool = False


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh file's whole content.

    Attributes:
        warnings: What the reader found odd but could read, a sentence each.
        self_contained: Nothing of it came from another file.
    """

    parts: tuple[Part, ...] = ()
    warnings: tuple[str, ...] = field(default=())
    self_contained: bool = True

    @property
    def triangle_count(self) -> int:
        """Number of triangles of all parts."""
        return sum(len(part.triangles) for part in self.parts)


def bounds(mesh: Mesh) -> tuple[FloatArray, FloatArray]:
    """Least and greatest corner, (3,) each, of the vertices that triangles use; zeros for an empty mesh."""
    used = [part.vertices[np.unique(part.triangles)] for part in mesh.parts if len(part.triangles)]
    if not used:
        return np.zeros(3), np.zeros(3)
    vertices = np.concatenate(used)
    return vertices.min(axis=0), vertices.max(axis=0)


def transformed(part: Part, placement: FloatArray) -> Part:
    """A part moved by a (4, 4) affine transform; a mirroring one turns the triangles over."""
    linear = placement[:3, :3]
    triangles = part.triangles[:, ::-1] if np.linalg.det(linear) < 0 else part.triangles
    return replace(
        part,
        vertices=part.vertices @ linear.T + placement[:3, 3],
        normals=unit(part.normals @ _normal_transform(linear).T),
        triangles=triangles,
    )


def _normal_transform(linear: FloatArray) -> FloatArray:
    """The cofactors: as the inverse transpose, but for its length, and there for singular matrices too."""
    rows = linear
    cofactors = np.array([np.cross(rows[1], rows[2]), np.cross(rows[2], rows[0]), np.cross(rows[0], rows[1])])
    return cofactors if np.linalg.det(linear) >= 0 else -cofactors


def unit(vectors: FloatArray) -> FloatArray:
    """(n, 3) vectors at length one; zero stays zero."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    result: FloatArray = np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0)
    return result
