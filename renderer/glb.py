"""Reader of GLB, the format of published meshes, to arrays with z up.

Reads triangles, node placements, base colours, roughness and metalness, but no textures, skins or
animations: a link is one rigid, painted body. Source: glTF 2.0, Khronos Group.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import GlbError
from robomesh import bounded_json
from robots.shapes.mesh import Y_UP_TO_Z_UP

_MAGIC = 0x46546C67
_JSON_CHUNK = 0x4E4F534A
_BINARY_CHUNK = 0x004E4942
_TRIANGLES = 4

_COMPONENTS: dict[int, str] = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles of one material, z up.

    Attributes:
        positions: (v, 3) float64 [m].
        normals: (v, 3) unit vectors, or None if the file has none.
        triangles: (t, 3) vertex numbers.
        color: (4,) sRGB and opacity, 0 to 1; None if the file has none.
        colors: (v, 4) the same for each vertex, or None.
    """

    positions: NDArray[np.float64]
    normals: NDArray[np.float64] | None
    triangles: NDArray[np.int64]
    color: tuple[float, float, float, float] | None
    colors: NDArray[np.float64] | None
    roughness: float
    metallic: float


def read_glb(data: bytes) -> tuple[Surface, ...]:
    """Return the surfaces of a GLB file.

    Raises:
        GlbError: If it is not GLB, is truncated, or has invalid content.
    """
    document, binary = _chunks(data)
    try:
        return tuple(_surfaces(document, binary))
    except (AttributeError, KeyError, IndexError, TypeError, ValueError) as error:
        raise GlbError(f"the GLB's content is inconsistent: {error!r}") from None


def glb_to_z_up(data: bytes) -> NDArray[np.float64]:
    """Return the (4, 4) rotation from a GLB's own axes, after its nodes' placements, to z up.

    Raises:
        GlbError: If it is not GLB, or is truncated.
    """
    return _file_to_z_up(_chunks(data)[0])


def _chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    if len(data) < 20 or struct.unpack_from("<I", data)[0] != _MAGIC:
        raise GlbError(f"{len(data)} bytes are not GLB, which begins with 'glTF'")
    _, version, length = struct.unpack_from("<III", data)
    if version != 2 or length > len(data):
        raise GlbError(
            f"GLB version {version} declares {length} bytes and has {len(data)}: "
            "version 2, complete, is needed"
        )
    document: dict[str, Any] | None = None
    binary = b""
    at = 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<II", data, at)
        body = data[at + 8 : at + 8 + size]
        if kind == _JSON_CHUNK:
            try:
                document = bounded_json.loads(body)
            except (ValueError, RecursionError) as error:
                raise GlbError(f"the GLB's JSON chunk is invalid: {error}") from None
        elif kind == _BINARY_CHUNK:
            binary = body
        at += 8 + size
    if not isinstance(document, dict):
        raise GlbError("the GLB has no JSON chunk with an object")
    return document, binary


def _surfaces(document: dict[str, Any], binary: bytes) -> Iterator[Surface]:
    for mesh_number, node_to_z_up in _meshes(document):
        for primitive in document["meshes"][mesh_number]["primitives"]:
            if primitive.get("mode", _TRIANGLES) == _TRIANGLES:
                yield _surface(document, binary, primitive, node_to_z_up)


def _meshes(document: dict[str, Any]) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """Yield (mesh number, node_to_z_up) of every node with a mesh."""
    nodes, scenes = document.get("nodes", []), document.get("scenes", [])
    children = {child for node in nodes for child in node.get("children", [])}
    roots = [number for number in range(len(nodes)) if number not in children]
    if scenes:
        roots = scenes[document.get("scene", 0)].get("nodes", [])
    waiting = [(number, _file_to_z_up(document)) for number in roots]
    visits = 0
    while waiting:
        visits += 1
        if visits > len(nodes):
            raise GlbError("the GLB's nodes form a cycle")
        number, parent_to_z_up = waiting.pop()
        node = nodes[number]
        node_to_z_up = parent_to_z_up @ _placement(node)
        if "mesh" in node:
            yield node["mesh"], node_to_z_up
        waiting += [(child, node_to_z_up) for child in node.get("children", [])]


def _file_to_z_up(document: dict[str, Any]) -> NDArray[np.float64]:
    asset = document.get("asset")
    extras = asset.get("extras") if isinstance(asset, dict) else None
    if isinstance(extras, dict) and extras.get("robomesh") == {"up": "z"}:
        return np.eye(4)  # from before 2026-11, for example in a recording
    return Y_UP_TO_Z_UP


def _placement(node: dict[str, Any]) -> NDArray[np.float64]:
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    placement = np.eye(4)
    placement[:3, :3] = rotation * np.array(node.get("scale", (1.0, 1.0, 1.0)))
    placement[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return placement


def _surface(
    document: dict[str, Any], binary: bytes, primitive: dict[str, Any], node_to_z_up: NDArray[np.float64]
) -> Surface:
    attributes = primitive["attributes"]
    positions = _accessor(document, binary, attributes["POSITION"])
    if not np.isfinite(positions).all():
        raise GlbError("the GLB has positions that are not finite")
    if "indices" in primitive:
        triangles = _accessor(document, binary, primitive["indices"]).astype(np.int64).reshape(-1, 3)
    else:
        triangles = np.arange(len(positions), dtype=np.int64).reshape(-1, 3)
    if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(positions):
        raise GlbError(f"the GLB's triangles use vertex {triangles.max()} of {len(positions)}")
    normals = None
    if "NORMAL" in attributes:
        # Normals need the inverse transpose: otherwise a scaled node would tilt them.
        normals = _accessor(document, binary, attributes["NORMAL"]) @ np.linalg.inv(node_to_z_up[:3, :3])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    if np.linalg.det(node_to_z_up[:3, :3]) < 0:
        triangles = triangles[:, ::-1]
    color, roughness, metallic = _material(document, primitive.get("material"))
    colors = None
    if "COLOR_0" in attributes:
        colors = np.ones((len(positions), 4))
        given = _accessor(document, binary, attributes["COLOR_0"])
        colors[:, : given.shape[1]] = given
        # Linear light in the file, like the materials' factors.
        low = colors[:, :3] <= 0.0031308
        colors[:, :3] = np.where(low, 12.92 * colors[:, :3], 1.055 * colors[:, :3] ** (1 / 2.4) - 0.055)
    return Surface(
        positions=positions @ node_to_z_up[:3, :3].T + node_to_z_up[:3, 3],
        normals=normals,
        triangles=triangles,
        color=color,
        colors=colors,
        roughness=roughness,
        metallic=metallic,
    )


def _accessor(document: dict[str, Any], binary: bytes, number: int) -> NDArray[np.float64]:
    """Return (n, width) values; normalised integers become 0 to 1."""
    accessor = document["accessors"][number]
    view = document["bufferViews"][accessor["bufferView"]]
    component = np.dtype(_COMPONENTS[accessor["componentType"]])
    width = _WIDTHS[accessor["type"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    values = np.ndarray(
        (accessor["count"], width),
        component,
        binary,
        start,
        (view.get("byteStride", component.itemsize * width), component.itemsize),
    ).astype(np.float64)
    if accessor.get("normalized"):
        values /= np.iinfo(component).max
    return values


def _material(
    document: dict[str, Any], number: int | None
) -> tuple[tuple[float, float, float, float] | None, float, float]:
    """Return colour, roughness and metalness.

    glTF's defaults are 1 for the last two; exporters that leave them out mean paint, not rough iron.
    """
    if number is None:
        return None, 0.5, 0.0
    surface = document["materials"][number].get("pbrMetallicRoughness", {})
    roughness, metallic = surface.get("roughnessFactor", 0.5), surface.get("metallicFactor", 0.0)
    if "baseColorFactor" not in surface:
        return None, roughness, metallic
    linear = surface["baseColorFactor"]
    red, green, blue = (_linear_to_srgb(value) for value in linear[:3])
    return (red, green, blue, float(linear[3])), roughness, metallic


def _linear_to_srgb(value: float) -> float:
    return float(12.92 * value if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055)
