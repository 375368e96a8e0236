"""Reader of glTF, as a file or as published GLB: triangles, lines and points with the colours of materials.

Textures are kept by name; skins and animations are ignored, because a link is one rigid, painted body. What
a small file could draw many times is counted before memory is allocated. Source: glTF 2.0, Khronos Group.
"""

import base64
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import unquote

import numpy as np

from robomesh import bounded_json
from robots.schema.errors import ShapeError
from robots.shapes.files.declared_size import Declared, below, content, textures_below
from robots.shapes.files.trimesh_formats import geometry_of, part_of
from robots.shapes.geometry import (
    Y_UP_TO_Z_UP,
    FloatArray,
    Geometry,
    IndexArray,
    Material,
    Part,
    Wire,
    normal_transform,
    unit,
)

JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
POINTS, LINES, TRIANGLES = 0, 1, 4
_STRIP = 5
# Points and triangle corners, counted once for each node that draws them.
MAX_DRAWN = 30_000_000
# Values of an accessor without data, which are zeros.
_MOST_ZEROS = 1_000_000
# In `asset.extras["robomesh"]` of our GLB; before 2026-11 it was {"up": "z"}, and nothing was turned.
TURNED_MARK = {"up": "y", "content_up": "z"}
_COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_GLOSSY = "KHR_materials_pbrSpecularGlossiness"
_PUBLISHED = "the GLB"

_Content = TypeVar("_Content")


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles, lines or points of one material, placed by the file's nodes.

    Attributes:
        mode: TRIANGLES, LINES or POINTS.
        vertices: (v, 3).
        normals: (v, 3) unit vectors, or None if the file has none.
        indices: (n, 3), (n, 2) or (n, 1) vertex numbers.
        color: (4,) sRGB and opacity, 0 to 1; None if the material has none.
        colors: (v, 4) the same for each vertex, or None.
        material: The material, as in the file; empty: the file names none.
    """

    name: str
    mode: int
    vertices: FloatArray
    normals: FloatArray | None
    indices: IndexArray
    color: tuple[float, float, float, float] | None
    colors: FloatArray | None
    roughness: float
    metallic: float
    material: dict[str, Any]


def read_gltf(path: Path, *, kind: str = "") -> Geometry:
    """Return the content of a glTF or GLB file, in metres and in the file's axes.

    Files with its buffers must be in the same folder, or in folders of it.

    Args:
        kind: "glb" or "gltf"; the file's ending by default.

    Raises:
        ShapeError: If it is not such a file, lacks a file, or draws too much.
    """
    data, binary = content(path), b""
    if (kind or path.suffix.lower().lstrip(".")) == "glb":
        document, binary = glb_chunks(data, path)
    else:
        document = _parsed(data, path)
    return _consistent(path, lambda: _File(path, document, binary).geometry(path))


def read_glb(data: bytes) -> tuple[Surface, ...]:
    """Return the surfaces of published GLB, z up [m].

    Raises:
        ShapeError: If it is not GLB, is truncated, or has invalid content.
    """
    document, binary = glb_chunks(data, _PUBLISHED)
    return _consistent(
        _PUBLISHED,
        lambda: tuple(_File(_PUBLISHED, document, binary).surfaces(_file_to_z_up(document))),
    )


def glb_to_z_up(data: bytes) -> FloatArray:
    """Return the (4, 4) rotation from a GLB's own axes, after its nodes' placements, to z up.

    Raises:
        ShapeError: If it is not GLB, or is truncated.
    """
    document, _ = glb_chunks(data, _PUBLISHED)
    return _consistent(_PUBLISHED, lambda: _file_to_z_up(document))


def glb_chunks(data: bytes, source: str | Path) -> tuple[dict[str, Any], bytes]:
    """Return the JSON object of GLB and its binary chunk, which may be empty.

    Raises:
        ShapeError: If it is not GLB, or is truncated.
    """
    if len(data) < 20 or data[:4] != b"glTF":
        raise ShapeError(source, "is not a GLB file: one begins with 'glTF'")
    version, length, size, kind = struct.unpack_from("<IIII", data, 4)
    if version != 2:
        raise ShapeError(source, f"is glTF version {version}; only version 2 is read", place="byte 4")
    if kind != JSON_CHUNK or 20 + size > len(data) or length > len(data):
        raise ShapeError(source, f"is truncated or damaged: declares {length} bytes, has {len(data)}")
    document, after, binary = _parsed(data[20 : 20 + size], source), 20 + size, b""
    if after + 8 <= length:
        size, kind = struct.unpack_from("<II", data, after)
        binary = data[after + 8 : after + 8 + size] if kind == BINARY_CHUNK else b""
    return document, binary


def _parsed(data: bytes, source: str | Path) -> dict[str, Any]:
    try:
        document = bounded_json.loads(data)
    except (ValueError, RecursionError) as error:
        raise ShapeError(source, f"its JSON is invalid: {error}") from error
    if not isinstance(document, dict):
        raise ShapeError(source, "its JSON is not an object")
    return document


def _consistent(source: str | Path, read: Callable[[], _Content]) -> _Content:
    """Return what a function reads; JSON of another shape and values beyond their buffer are a ShapeError."""
    try:
        # An overflow becomes infinite, which is reported.
        with np.errstate(all="ignore"):
            return read()
    except MemoryError as error:
        raise ShapeError(source, "needs more memory than is available") from error
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise ShapeError(source, f"its content is inconsistent: {error!r}") from error


def _axes(document: dict[str, Any]) -> tuple[str, bool]:
    """Return the content's upward axis, and whether our writer turned it from z up to y up."""
    extras = document.get("asset", {}).get("extras")
    own = extras.get("robomesh") if isinstance(extras, dict) else None
    return "z" if own else "y", isinstance(own, dict) and own.items() >= TURNED_MARK.items()


def _file_to_z_up(document: dict[str, Any]) -> FloatArray:
    return np.eye(4) if _axes(document) == ("z", False) else Y_UP_TO_Z_UP


class _File:
    """A glTF document with its buffers; `source` is its path, or words for errors."""

    def __init__(self, source: str | Path, document: dict[str, Any], binary: bytes) -> None:
        self._source, self._document = source, document
        self._files: list[Path] = []
        self._buffers = [self._buffer(each.get("uri"), binary) for each in document.get("buffers", [])]

    def _buffer(self, address: str | None, binary: bytes) -> bytes:
        if address is None:
            return binary
        if address.startswith("data:"):
            return base64.b64decode(address.partition(",")[2])
        file = below(self._source, unquote(address)) if isinstance(self._source, Path) else None
        if file is None or not file.is_file():
            reason = f"buffer {address!r}: no such file in this folder"
            raise ShapeError(self._source, reason, missing=address)
        self._files.append(file)
        return content(file)

    def geometry(self, path: Path) -> Geometry:
        up, turned = _axes(self._document)
        textures = [self._texture(each) for each in self._document.get("materials", [])]
        files = (*self._files, *textures_below(path, filter(None, textures)))
        shapes = [self._shape(each) for each in self.surfaces(Y_UP_TO_Z_UP if turned else np.eye(4))]
        return geometry_of(path, shapes, Declared(unit_m=1.0, up=up, files=files))

    def surfaces(self, root: FloatArray) -> Iterator[Surface]:
        """Yield the surfaces, with the scene's nodes placed below a root."""
        required = [str(name) for name in self._document.get("extensionsRequired", [])]
        packed = [name for name in required if "draco" in name.lower() or "meshopt" in name.lower()]
        if packed:
            reason = f"is compressed with {', '.join(packed)}; export it without compression"
            raise ShapeError(self._source, reason)
        placed = list(self._meshes(root))
        drawn = sum(self._drawn(geometry) for geometry, _ in placed)
        if drawn > MAX_DRAWN:
            reason = f"draws {drawn} points and corners; at most {MAX_DRAWN} are read"
            raise ShapeError(self._source, reason)
        for geometry, placement in placed:
            for primitive in geometry["primitives"]:
                if primitive.get("mode", TRIANGLES) in (POINTS, LINES, TRIANGLES, _STRIP):
                    yield self._surface(str(geometry.get("name", "")), primitive, placement)

    def _meshes(self, root: FloatArray) -> Iterator[tuple[dict[str, Any], FloatArray]]:
        nodes, scenes = self._document.get("nodes", []), self._document.get("scenes", [])
        children = {child for node in nodes for child in node.get("children", [])}
        roots = [number for number in range(len(nodes)) if number not in children]
        if scenes:
            roots = scenes[self._document.get("scene", 0)].get("nodes", [])
        waiting = [(number, root) for number in reversed(roots)]
        seen: set[int] = set()
        while waiting:
            number, parent = waiting.pop()
            if number in seen:
                reason = f"node {number} has two parents, or is its own ancestor"
                raise ShapeError(self._source, reason)
            seen.add(number)
            node = nodes[number]
            placement = parent @ _placement(node)
            if "mesh" in node:
                yield self._document["meshes"][node["mesh"]], placement
            waiting += [(child, placement) for child in reversed(node.get("children", []))]

    def _drawn(self, geometry: dict[str, Any]) -> int:
        """Return the number of points and corners that a shape draws."""
        used = [(each["attributes"]["POSITION"], each.get("indices")) for each in geometry["primitives"]]
        numbers = [number for pair in used for number in pair if number is not None]
        return sum(abs(int(self._document["accessors"][number]["count"])) for number in numbers)

    def _surface(self, name: str, primitive: dict[str, Any], placement: FloatArray) -> Surface:
        attributes, mode = primitive["attributes"], primitive.get("mode", TRIANGLES)
        linear = placement[:3, :3]
        vertices = self._values(attributes["POSITION"]) @ linear.T + placement[:3, 3]
        if not np.isfinite(vertices).all():
            raise ShapeError(self._source, f"{name!r} has a vertex with a non-finite coordinate")
        numbers = np.arange(len(vertices), dtype=np.int64)
        if "indices" in primitive:
            numbers = self._values(primitive["indices"]).astype(np.int64).ravel()
        if len(numbers) and not 0 <= numbers.min() <= numbers.max() < len(vertices):
            reason = f"{name!r} uses vertex {numbers.max()}; there are {len(vertices)}"
            raise ShapeError(self._source, reason)
        if mode == _STRIP:
            # Every second triangle of a strip is wound the other way.
            numbers = np.column_stack([numbers[:-2], numbers[1:-1], numbers[2:]])
            numbers[1::2] = numbers[1::2, ::-1]
            mode = TRIANGLES
        indices = numbers.reshape(-1, {POINTS: 1, LINES: 2}.get(mode, 3))
        if mode == TRIANGLES and np.linalg.det(linear) < 0:
            indices = indices[:, ::-1]
        normals = colors = None
        if "NORMAL" in attributes:
            given = self._values(attributes["NORMAL"])
            if given.shape == vertices.shape and np.isfinite(given).all():
                normals = unit(given @ normal_transform(linear).T)
        if "COLOR_0" in attributes:
            given = self._values(attributes["COLOR_0"])
            colors = np.ones((len(vertices), 4))
            colors[:, : given.shape[1]] = _shares(given)
            colors[:, :3] = _srgb_of_linear(colors[:, :3])
        material = self._document["materials"][primitive["material"]] if "material" in primitive else {}
        physical = material.get("pbrMetallicRoughness", {})
        glossy = material.get("extensions", {}).get(_GLOSSY, {})
        color = None
        if base := physical.get("baseColorFactor") or glossy.get("diffuseFactor"):
            *linear_color, opacity = _shares(base)
            red, green, blue = _srgb_of_linear(np.array(linear_color)).tolist()
            color = red, green, blue, float(opacity)
        # The defaults of glTF are 1 for both; exporters that leave them out mean paint, not rough iron.
        roughness = float(physical.get("roughnessFactor", 0.5))
        metallic = float(physical.get("metallicFactor", 0.0))
        return Surface(name, mode, vertices, normals, indices, color, colors, roughness, metallic, material)

    def _values(self, number: int) -> FloatArray:
        """Return the (n, width) values of an accessor; normalised integers become 0 to 1."""
        accessor = self._document["accessors"][number]
        component, width = np.dtype(_COMPONENTS[accessor["componentType"]]), _WIDTHS[accessor["type"]]
        count = accessor["count"]
        if "bufferView" not in accessor:
            if not 0 <= count <= _MOST_ZEROS:
                reason = f"an accessor's count is {count}; without data it must be 0 to {_MOST_ZEROS}"
                raise ShapeError(self._source, reason)
            return np.zeros((count, width))
        view = self._document["bufferViews"][accessor["bufferView"]]
        row = component.itemsize * width
        stride = view.get("byteStride", row)
        # With rows that overlap, a small file would have any number of them.
        if stride < row:
            raise ShapeError(self._source, f"rows of {row} bytes are {stride} bytes apart")
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        data = self._buffers[view.get("buffer", 0)]
        steps = (stride, component.itemsize)
        values = np.ndarray((count, width), component, data, start, steps).astype(np.float64)
        return values / np.iinfo(component).max if accessor.get("normalized") else values

    def _shape(self, surface: Surface) -> Part | Wire:
        found, color, texture = surface.material, surface.color, self._texture(surface.material)
        # Textures are not drawn: without a base colour, a textured material gets the default grey.
        plain = Material().diffuse if texture or not found else (1.0, 1.0, 1.0)
        glow = _srgb_of_linear(_shares(found.get("emissiveFactor", (0.0, 0.0, 0.0))))
        material = Material(
            name=str(found.get("name", "")),
            diffuse=plain if color is None else color[:3],
            emissive=(float(glow[0]), float(glow[1]), float(glow[2])),
            transparency=1.0 - color[3] if color and found.get("alphaMode") == "BLEND" else 0.0,
            texture=texture,
        )
        if surface.mode != TRIANGLES:
            segments = surface.indices if surface.mode == LINES else np.zeros((0, 2), dtype=np.int64)
            return Wire(surface.name, material, surface.vertices, segments, surface.colors)
        normals = np.zeros((0, 3)) if surface.normals is None else surface.normals
        part = Part(surface.name, material, surface.vertices, normals, surface.indices)
        return part_of(replace(part, two_sided=bool(found.get("doubleSided")), colors=surface.colors))

    def _texture(self, material: dict[str, Any]) -> str:
        """Return the name of a material's texture; empty: it has none."""
        try:
            index = material["pbrMetallicRoughness"]["baseColorTexture"]["index"]
            image = self._document["images"][self._document["textures"][index]["source"]]
            return str(image.get("uri") or image.get("name") or "image in the file")[:200]
        except (KeyError, IndexError, TypeError, AttributeError):
            extras = material.get("extras")
            own = extras.get("texture") if isinstance(extras, dict) else ""
            return own if isinstance(own, str) else ""


def _placement(node: dict[str, Any]) -> FloatArray:
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


def _shares(values: Any) -> FloatArray:
    """Return numbers, limited to 0 to 1."""
    return np.clip(np.nan_to_num(np.asarray(values, dtype=np.float64)), 0.0, 1.0)


def _srgb_of_linear(values: FloatArray) -> FloatArray:
    """Convert linear light, 0 to 1, to sRGB."""
    result: FloatArray = np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1 / 2.4) - 0.055)
    return result
