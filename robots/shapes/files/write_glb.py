"""GLB writer: triangles, lines and points, with the colours of materials and vertices.

glTF defines y as up, and a robot's axes are z up: the root node turns them. The same shape gives the same
bytes. Source: glTF 2.0, Khronos Group, 3.4.
"""

import json
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots.shapes.files.gltf import BINARY_CHUNK, JSON_CHUNK, LINES, POINTS, TRIANGLES, TURNED_MARK
from robots.shapes.geometry import Y_UP_TO_Z_UP, Color, FloatArray, Geometry, Material, Part, Wire

_FLOAT, _UINT = 5126, 5125
_VERTICES, _INDICES = 34962, 34963
# Metallic and roughness factors of some materials; the older shape formats cannot state them.
_FINISHES = {"paint": (0.0, 0.45), "casting": (0.25, 0.6), "steel": (0.85, 0.3), "rubber": (0.0, 0.9)}


@dataclass
class _Document:
    accessors: list[dict[str, Any]] = field(default_factory=list)
    views: list[dict[str, Any]] = field(default_factory=list)
    materials: list[dict[str, Any]] = field(default_factory=list)
    meshes: list[dict[str, Any]] = field(default_factory=list)
    nodes: list[dict[str, Any]] = field(default_factory=list)
    binary: bytearray = field(default_factory=bytearray)

    def accessor(self, array: NDArray[Any], kind: str, target: int, *, bounded: bool = False) -> int:
        self.views.append(
            {"buffer": 0, "byteOffset": len(self.binary), "byteLength": array.nbytes, "target": target}
        )
        self.binary += array.tobytes()
        found: dict[str, Any] = {
            "bufferView": len(self.views) - 1,
            "componentType": _FLOAT if array.dtype == np.float32 else _UINT,
            "count": len(array) if kind != "SCALAR" else array.size,
            "type": kind,
        }
        if bounded:
            found |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        self.accessors.append(found)
        return len(self.accessors) - 1


def glb_of(geometry: Geometry) -> bytes:
    """Return binary glTF in the geometry's unit: one glTF mesh per material, then lines and points."""
    document = _Document()
    for part in merged(geometry.parts):
        if len(part.triangles):
            _add(document, part, part.triangles, TRIANGLES, part.two_sided)
    for wire in geometry.wires:
        if len(wire.vertices):
            _add(document, wire, wire.segments, LINES if len(wire.segments) else POINTS, False)
    return _packed(document, _main_color(geometry))


def _main_color(geometry: Geometry) -> Color | None:
    """Return the colour that covers most of a shape; None: it has no triangles."""
    areas: dict[Color, float] = {}
    for part in geometry.parts:
        corners = part.vertices[part.triangles]
        doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        color = part.material.diffuse
        if part.colors is not None and len(part.colors):
            red, green, blue, _ = part.colors.mean(axis=0).tolist()
            color = (red, green, blue)
        areas[color] = areas.get(color, 0.0) + float(np.linalg.norm(doubled, axis=1).sum())
    return max(areas, key=lambda color: areas[color], default=None)


def merged(parts: Iterable[Part]) -> list[Part]:
    """Join parts of one material, so that there are fewer to draw."""
    groups: dict[tuple[Material, bool, bool], list[Part]] = {}
    for part in parts:
        groups.setdefault((part.material, part.two_sided, part.colors is not None), []).append(part)
    return [_joined(group) if len(group) > 1 else group[0] for group in groups.values()]


def _joined(parts: Sequence[Part]) -> Part:
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts)])
    colors = [part.colors for part in parts if part.colors is not None]
    return replace(
        parts[0],
        vertices=np.concatenate([part.vertices for part in parts]),
        normals=np.concatenate([part.normals for part in parts]),
        triangles=np.concatenate(
            [part.triangles + offset for part, offset in zip(parts, offsets, strict=False)]
        ),
        colors=np.concatenate(colors) if colors else None,
    )


def _add(document: _Document, shape: Part | Wire, indices: NDArray[np.int64], mode: int, both: bool) -> None:
    attributes = {
        "POSITION": document.accessor(_floats(shape.vertices), "VEC3", _VERTICES, bounded=True),
    }
    if isinstance(shape, Part):
        attributes["NORMAL"] = document.accessor(_floats(_unit(shape.normals)), "VEC3", _VERTICES)
    blended = shape.material.transparency > 0
    if shape.colors is not None:
        colors = np.column_stack([linear(shape.colors[:, :3]), shape.colors[:, 3:]])
        attributes["COLOR_0"] = document.accessor(_floats(colors), "VEC4", _VERTICES)
        blended = bool((shape.colors[:, 3] < 1).any())
    primitive: dict[str, Any] = {"attributes": attributes, "mode": mode}
    if len(indices):
        primitive["indices"] = document.accessor(
            np.ascontiguousarray(indices, dtype="<u4"), "SCALAR", _INDICES
        )
    primitive["material"] = len(document.materials)
    document.materials.append(_material(shape, len(document.materials), both, blended))
    name = f"{len(document.meshes)} {shape.name}".strip()
    document.nodes.append({"name": name, "mesh": len(document.meshes)})
    document.meshes.append({"name": name, "primitives": [primitive]})


def _material(shape: Part | Wire, number: int, both: bool, blended: bool) -> dict[str, Any]:
    material = shape.material
    metallic, roughness = _FINISHES.get(material.name, (0.0, 0.55))
    # glTF multiplies vertex colours by the base colour, so the base is white.
    base = (
        [1.0, 1.0, 1.0, 1.0]
        if shape.colors is not None
        else [*linear_color(material.diffuse), 1.0 - material.transparency]
    )
    found: dict[str, Any] = {
        "name": material.name or f"material {number}",
        "pbrMetallicRoughness": {
            "baseColorFactor": base,
            "metallicFactor": metallic,
            "roughnessFactor": roughness,
        },
        "doubleSided": both,
    }
    if any(material.emissive):
        found["emissiveFactor"] = linear_color(material.emissive)
    if blended:
        found["alphaMode"] = "BLEND"
    if material.texture:
        found["extras"] = {"texture": material.texture}
    return found


def _packed(document: _Document, main: Color | None) -> bytes:
    own = TURNED_MARK if main is None else {**TURNED_MARK, "main_color": [round(each, 4) for each in main]}
    content: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "robomesh", "extras": {"robomesh": own}},
        "scene": 0,
        "scenes": [{}],
    }
    if document.nodes:
        # The matrix, by columns, has only 0 and 1: turning back gives the same numbers.
        root = {"name": "z up", "matrix": Y_UP_TO_Z_UP.ravel().tolist()}
        content["scenes"] = [{"nodes": [len(document.nodes)]}]
        document.nodes.append({**root, "children": list(range(len(document.nodes)))})
    # glTF allows no empty lists.
    for key, items in (
        ("nodes", document.nodes),
        ("meshes", document.meshes),
        ("materials", document.materials),
        ("accessors", document.accessors),
        ("bufferViews", document.views),
        ("buffers", [{"byteLength": len(document.binary)}] if document.binary else []),
    ):
        if items:
            content[key] = items
    text = json.dumps(content, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), JSON_CHUNK) + text
    if document.binary:
        chunks += struct.pack("<II", len(document.binary), BINARY_CHUNK) + document.binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _floats(array: FloatArray) -> NDArray[np.float32]:
    return np.ascontiguousarray(array, dtype="<f4")


def _unit(normals: FloatArray) -> FloatArray:
    """Replace missing normals of degenerate triangles by z: glTF requires length one."""
    none = ~np.isfinite(normals).all(axis=1) | (np.abs(normals).max(axis=1, initial=0.0) == 0)
    return np.where(none[:, None], [0.0, 0.0, 1.0], normals) if none.any() else normals


def linear(colors: FloatArray) -> FloatArray:
    """Convert sRGB, 0 to 1, to linear light, which glTF uses."""
    result: FloatArray = np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4)
    return result


def linear_color(color: Color) -> list[float]:
    """Convert one sRGB colour to linear light."""
    found: list[float] = linear(np.array(color, dtype=np.float64)).tolist()
    return found
