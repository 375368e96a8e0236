"""VRML 2.0 files to meshes: what each node of a scene draws.

Source: ISO/IEC 14772-1:1997, clause 6.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from robots.errors import MeshError
from robots.meshes.mesh import FloatArray, Material, Mesh, Part, transformed
from robots.meshes.vrml_geometry import GEOMETRY, Geometry
from robots.meshes.vrml_parser import MAX_DEPTH, Is, Node, Proto, Value, parse_vrml
from robots.meshes.vrml_values import color, line_error, node_of, nodes_of, numbers, strings

# A few USEs of USEs can make billions of nodes.
MAX_NODES = 200_000
_GROUPS = {"Group", "Anchor", "Billboard", "Collision", "Transform"}
# Geometry without triangles, or not drawn yet.
_NOT_DRAWN = {"IndexedLineSet", "PointSet", "Text", "ElevationGrid", "Extrusion"}


def read_vrml(path: Path) -> Mesh:
    """The triangles of a .wrl file, in its own units and axes; Inline files are read too.

    Raises:
        MeshError: If it is not a VRML 2.0 file that can be read, with the line.
    """
    return _read(path, ())


def _read(path: Path, including: tuple[Path, ...]) -> Mesh:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MeshError(path, f"cannot be read: {error.strerror}") from error
    if data[:2] == b"\x1f\x8b":
        raise MeshError(path, "is compressed by gzip; unpack it first")
    if b"\0" in data[:1024]:
        raise MeshError(path, "is not VRML 2.0: it holds binary data")
    text = data.decode("utf-8", errors="replace")
    scene = parse_vrml(text, path)
    walk = _Walk(path, including, list(scene.warnings))
    parts = tuple(part for node in scene.nodes for part in walk.parts(node, np.eye(4), 0))
    return Mesh(parts, tuple(walk.warnings), self_contained=not walk.inlined)


@dataclass
class _Walk:
    """One file's way through its scene."""

    path: Path
    including: tuple[Path, ...]
    warnings: list[str] = field(default_factory=list)
    inlined: bool = False
    drawn: int = 0

    def parts(self, node: Node, placement: FloatArray, depth: int) -> Iterator[Part]:
        if depth > MAX_DEPTH:
            raise line_error(self.path, node, f"nested deeper than {MAX_DEPTH}")
        self.drawn += 1
        if self.drawn > MAX_NODES:
            raise line_error(self.path, node, f"draws more than {MAX_NODES} nodes")
        if node.proto is not None:
            body = _instance(node, node.proto)
            if body is not None:
                yield from self.parts(body, placement, depth + 1)
        elif node.type == "Shape":
            yield from self.shape(node, placement)
        elif node.type == "Inline":
            yield from self.inline(node, placement)
        else:
            below = placement @ transform_matrix(node, self.path) if node.type == "Transform" else placement
            for child in self.children(node):
                yield from self.parts(child, below, depth + 1)

    def children(self, node: Node) -> list[Node]:
        if node.type in _GROUPS:
            return nodes_of(node, "children")
        if node.type == "LOD":
            return (nodes_of(node, "level") or nodes_of(node, "children"))[:1]
        if node.type == "Switch":
            choices = nodes_of(node, "choice") or nodes_of(node, "children")
            which = int(numbers(node, "whichChoice", [-1.0], self.path)[0])
            return choices[which : which + 1] if which >= 0 else []
        # Lights, sensors, viewpoints, scripts: nothing of them is drawn.
        return []

    def shape(self, node: Node, placement: FloatArray) -> Iterator[Part]:
        shape = _resolved(node_of(node, "geometry"))
        if shape is None:
            return
        if shape.type in _NOT_DRAWN:
            self.warn(f"line {shape.line}: {shape.type} is left out")
            return
        build: Callable[[Node, Path], Geometry] | None = GEOMETRY.get(shape.type)
        if build is None:
            self.warn(f"line {shape.line}: {shape.type} is no geometry of VRML 2.0; left out")
            return
        geometry = build(shape, self.path)
        if not len(geometry.triangles):
            return
        part = Part(
            name=shape.name or node.name,
            material=self.material(node),
            vertices=geometry.vertices,
            normals=geometry.normals,
            triangles=geometry.triangles,
            two_sided=not geometry.solid,
        )
        yield transformed(part, placement)

    def material(self, shape: Node) -> Material:
        appearance = _resolved(node_of(shape, "appearance"))
        node = _resolved(node_of(appearance, "material")) if appearance is not None else None
        if node is None:
            return Material()
        return Material(
            name=node.name,
            diffuse=color(node, "diffuseColor", (0.8, 0.8, 0.8), self.path),
            specular=color(node, "specularColor", (0.0, 0.0, 0.0), self.path),
            emissive=color(node, "emissiveColor", (0.0, 0.0, 0.0), self.path),
            shininess=_clipped(numbers(node, "shininess", [0.2], self.path)[0]),
            transparency=_clipped(numbers(node, "transparency", [0.0], self.path)[0]),
        )

    def inline(self, node: Node, placement: FloatArray) -> Iterator[Part]:
        self.inlined = True
        chain = (*self.including, self.path.resolve())
        addresses = strings(node, "url")
        for address in addresses:
            path = (self.path.parent / address).resolve()
            if "://" in address or not path.is_file():
                continue
            if path in chain:
                raise line_error(self.path, node, f"Inline {address!r} leads back to itself")
            mesh = _read(path, chain)
            self.warnings.extend(f"{address}: {warning}" for warning in mesh.warnings)
            for part in mesh.parts:
                yield transformed(part, placement)
            return
        if addresses:
            raise line_error(self.path, node, f"Inline {addresses[0]!r}: no such file beside this one")

    def warn(self, warning: str) -> None:
        if len(self.warnings) < 100:
            self.warnings.append(warning)


def transform_matrix(node: Node, path: Path) -> FloatArray:
    """(4, 4) of a Transform: `T C R SR S -SR -C`."""
    center = _translation(numbers(node, "center", [0, 0, 0], path, 3))
    stretch = _rotation(numbers(node, "scaleOrientation", [0, 0, 1, 0], path, 4))
    scale = np.diag([*numbers(node, "scale", [1, 1, 1], path, 3), 1.0])
    return (
        _translation(numbers(node, "translation", [0, 0, 0], path, 3))
        @ center
        @ _rotation(numbers(node, "rotation", [0, 0, 1, 0], path, 4))
        @ stretch
        @ scale
        @ stretch.T
        @ np.linalg.inv(center)
    )


def _translation(vector: FloatArray) -> FloatArray:
    matrix = np.eye(4)
    matrix[:3, 3] = vector
    return matrix


def _rotation(axis_angle: FloatArray) -> FloatArray:
    """Rodrigues' formula; the axis need not have length one."""
    matrix = np.eye(4)
    length = np.linalg.norm(axis_angle[:3])
    if length > 0:
        x, y, z = axis_angle[:3] / length
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        angle = axis_angle[3]
        matrix[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return matrix


def _resolved(node: Node | None) -> Node | None:
    """A node, or what the PROTO that it is an instance of stands for."""
    for _ in range(MAX_DEPTH):
        if node is None or node.proto is None:
            return node
        node = _instance(node, node.proto)
    return None


def _instance(use: Node, proto: Proto) -> Node | None:
    """The PROTO's first body node with the values of this use; only the first is drawn."""
    if not proto.body:
        return None
    given = proto.defaults | use.fields
    return _filled(proto.body[0], given)


def _filled(node: Node, given: dict[str, Value]) -> Node:
    fields: dict[str, Value] = {}
    for name, value in node.fields.items():
        if isinstance(value, Is):
            # Without a default and not given (an event, say): as if it were not written.
            if value.name in given:
                fields[name] = given[value.name]
        elif isinstance(value, list):
            fields[name] = [_filled(v, given) if isinstance(v, Node) else v for v in value]  # type: ignore[assignment]
        else:
            fields[name] = value
    return replace(node, fields=fields)


def _clipped(number: float) -> float:
    return float(np.clip(number, 0.0, 1.0))
