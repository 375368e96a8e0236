"""Conversion of a VRML scene's nodes to placed parts and wires.

Source: ISO/IEC 14772-1:1997, clause 6.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from robots.shapes.faces import Surface
from robots.shapes.files.vrml.files import Files
from robots.shapes.files.vrml.geometry import GEOMETRY
from robots.shapes.files.vrml.lines import STROKES, Strokes
from robots.shapes.files.vrml.parser import MAX_DEPTH, Node
from robots.shapes.files.vrml.protos import node_of, resolved
from robots.shapes.files.vrml.values import color, nodes_of, number, strings, transform_matrix
from robots.shapes.geometry import Color, FloatArray, Material, Part, Wire, placed, transformed

# A few nested USEs can expand to billions of nodes.
MAX_NODES = 200_000
MAX_TRIANGLES = 10_000_000
# Geometry with more vertices is not cached but made again at each USE: the cache would double the memory.
_MOST_KEPT = 10_000

# Limit of nested scales, far below an overflow.
_FARTHEST = 1e60

_IDENTITY = np.eye(4)
# Joint, Humanoid and Site, as well as Segment, are H-Anim's, for files that leave out its PROTOs.
_MOVING = {"Transform", "Joint", "Humanoid", "Site"}
_GROUPS = {"Group", "Anchor", "Billboard", "Collision", "Segment", *_MOVING}
_NOT_DRAWN = {
    "AudioClip",
    "Background",
    "ColorInterpolator",
    "CoordinateInterpolator",
    "CylinderSensor",
    "DirectionalLight",
    "Fog",
    "NavigationInfo",
    "NormalInterpolator",
    "OrientationInterpolator",
    "PlaneSensor",
    "PointLight",
    "PositionInterpolator",
    "ProximitySensor",
    "ScalarInterpolator",
    "Script",
    "Sound",
    "SphereSensor",
    "SpotLight",
    "TimeSensor",
    "TouchSensor",
    "Viewpoint",
    "VisibilitySensor",
    "WorldInfo",
}


@dataclass
class Drawing:
    """A collection of the parts and wires that nodes draw."""

    files: Files
    parts: list[Part] = field(default_factory=list)
    wires: list[Wire] = field(default_factory=list)
    _drawn: int = 0
    _triangles: int = 0
    _skipped: dict[str, Node] = field(default_factory=dict)
    # Text nodes by their words. Drawing them would take a font and its library.
    _texts: dict[str, Node] = field(default_factory=dict)
    _geometry: dict[Node, Surface | Strokes] = field(default_factory=dict)
    _materials: dict[Node, Material] = field(default_factory=dict)

    def draw(self, node: Node, placement: FloatArray, inside: tuple[Path, ...], depth: int = 0) -> None:
        """Draw a node and its children.

        Args:
            placement: (4, 4) from the node's coordinates to the shape's.
            inside: The files that are being drawn, from the outermost to the node's.

        Raises:
            ShapeError: If a field has an invalid value, or too much is drawn.
        """
        self._drawn += 1
        if self._drawn > MAX_NODES:
            raise node.error(f"the scene draws more than {MAX_NODES} nodes")
        if depth > MAX_DEPTH:
            raise node.error(f"nested deeper than {MAX_DEPTH}")
        found = resolved(node)
        if found is None:
            return
        if found.type == "Shape":
            self._shape(found, placement, node.name)
        elif found.type == "Inline":
            self._inline(found, placement, inside, depth)
        else:
            below = placement
            if found.type in _MOVING:
                below = placement @ transform_matrix(found)
                if np.abs(below).max() > _FARTHEST:
                    raise node.error(f"nested transforms reach beyond {_FARTHEST:g}")
            for child in self._children(found):
                self.draw(child, below, inside, depth + 1)

    def _children(self, node: Node) -> list[Node]:
        if node.type in _GROUPS:
            return nodes_of(node, "children") + nodes_of(node, "humanoidBody")
        if node.type == "LOD":
            return (nodes_of(node, "level") or nodes_of(node, "children"))[:1]
        if node.type == "Switch":
            choices = nodes_of(node, "choice") or nodes_of(node, "children")
            if not choices and "level" in node.fields:
                node.warn("has 'level', a field of LOD; read as 'choice'", once="level of a Switch")
                choices = nodes_of(node, "level")
            which = number(node, "whichChoice", -1.0)
            return choices[int(which) : int(which) + 1] if 0 <= which < len(choices) else []
        self._skipped.setdefault(node.type, node)
        return []

    def _shape(self, node: Node, placement: FloatArray, name: str) -> None:
        shape = node_of(node, "geometry")
        if shape is None:
            return
        drawn = self._geometry.get(shape) or self._made(shape)
        if drawn is None:
            return
        material = self._material(node)
        name = shape.name or node.name or name
        if isinstance(drawn, Strokes):
            if len(drawn.vertices):
                colors = _with_opacity(drawn.colors, material)
                wire = Wire(name, material, drawn.vertices, drawn.segments, colors)
                self.wires.append(placed(wire, placement))
            return
        self._triangles += len(drawn.triangles)
        if self._triangles > MAX_TRIANGLES:
            raise node.error(f"the scene draws more than {MAX_TRIANGLES} triangles")
        if not len(drawn.triangles):
            return
        part = Part(
            name,
            material,
            drawn.vertices,
            drawn.normals,
            drawn.triangles,
            two_sided=not drawn.solid,
            colors=_with_opacity(drawn.colors, material),
        )
        unmoved = np.array_equal(placement, _IDENTITY)
        self.parts.append(part if unmoved else transformed(part, placement))

    def _made(self, shape: Node) -> Surface | Strokes | None:
        drawn: Surface | Strokes
        if shape.type in GEOMETRY:
            drawn = GEOMETRY[shape.type](shape, self.files.effort)
            if drawn.rough:
                shape.warn("concave faces take too long to triangulate; some are drawn beyond their outline")
        elif shape.type in STROKES:
            drawn = STROKES[shape.type](shape)
        elif shape.type == "Text":
            self._texts.setdefault(" ".join(strings(shape, "string"))[:100], shape)
            return None
        else:
            shape.warn("is not a geometry node of VRML 2.0; left out", once=f"no {shape.type}")
            return None
        if len(drawn.vertices) <= _MOST_KEPT:
            self._geometry[shape] = drawn
        return drawn

    def _material(self, shape: Node) -> Material:
        """Return a Shape's material, without ambientIntensity, which glTF cannot express."""
        appearance = node_of(shape, "appearance")
        if appearance is None:
            return _material(None, "")
        if appearance not in self._materials:
            self._materials[appearance] = _material(
                node_of(appearance, "material"), self._texture(appearance)
            )
        return self._materials[appearance]

    def _texture(self, appearance: Node) -> str:
        texture = node_of(appearance, "texture")
        addresses = strings(texture, "url") if texture is not None else []
        if texture is None or not addresses:
            return ""
        if self.files.find(texture.source, addresses) is None:
            reason = self.files.reason_missing(addresses[0])
            texture.warn(f"{addresses[0][:200]!r}: {reason}", once=f"texture {addresses[0]}")
        return addresses[0]

    def _inline(self, node: Node, placement: FloatArray, inside: tuple[Path, ...], depth: int) -> None:
        addresses = strings(node, "url")
        found = self.files.find(node.source, addresses)
        if found is None:
            if addresses:
                reason = self.files.reason_missing(addresses[0])
                node.warn(f"{addresses[0][:200]!r}: {reason}; it is left out", once=f"inline {addresses[0]}")
            return
        if found in inside:
            raise node.error(f"{addresses[0][:200]!r} includes itself")
        for root in self.files.scene(found).nodes:
            self.draw(root, placement, (*inside, found), depth + 1)

    def warn_of_skipped(self) -> None:
        """Warn, once for each type, of nodes that were skipped."""
        words = [each for each in self._texts if each.strip()]
        if words:
            self._texts[words[0]].warn(f"is not drawn: {', '.join(map(repr, words[:100]))}")
        known = [name for name in self._skipped if name in _NOT_DRAWN]
        if known:
            node = self._skipped[known[0]]
            node.source.warn(node.position, f"not drawn: {', '.join(known)}")
        for name, node in self._skipped.items():
            if name not in _NOT_DRAWN:
                node.warn("is not a node of VRML 2.0; skipped", once=f"unknown {name}")


def _material(node: Node | None, texture: str) -> Material:
    if node is None:
        # White, by 6.3 and 6.41. The standard also says unlit, but without light the shape cannot be seen.
        return Material(diffuse=(1.0, 1.0, 1.0), texture=texture)
    none: Color = (0.0, 0.0, 0.0)
    return Material(
        name=node.name,
        diffuse=color(node, "diffuseColor", (0.8, 0.8, 0.8)),
        specular=color(node, "specularColor", none),
        emissive=color(node, "emissiveColor", none),
        shininess=_clipped(number(node, "shininess", 0.2)),
        transparency=_clipped(number(node, "transparency", 0.0)),
        texture=texture,
    )


def _with_opacity(colors: FloatArray | None, material: Material) -> FloatArray | None:
    """Return (v, 4) colours from (v, 3), with the material's opacity."""
    if colors is None:
        return None
    return np.column_stack([colors, np.full(len(colors), 1.0 - material.transparency)])


def _clipped(value: float) -> float:
    return min(max(value, 0.0), 1.0)
