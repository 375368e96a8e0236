"""Visual and collision geometry of the links of a URDF."""

import xml.etree.ElementTree as Xml
from math import cos, pi

import numpy as np

from robots.descriptions.urdf.files import Resolve, is_exact
from robots.descriptions.urdf.values import WrongElement, numbers, origin
from robots.kinematics.kinematic_tree import Shape
from robots.schema.poses import FloatArray
from robots.shapes.geometry import Geometry, Material, Part
from robots.shapes.normals import creased
from robots.shapes.solids import Solid, ball, box, turned

_ROUND = 32
# The faces of round collision geometry enclose the true shape. Inscribed faces would leave half a per cent
# of the radius unchecked.
_ROUNDER = 1 / cos(pi / _ROUND)
_Paint = tuple[tuple[float, float, float], float]


class Shapes:
    """The state of reading the shapes of one URDF.

    Attributes:
        missing: Shape files that were not found, as named in the file.
        unchecked: Missing files that a collision check would use.
        notes: Irregularities and how they were handled, a sentence each.
    """

    def __init__(self, root: Xml.Element, resolve: Resolve) -> None:
        self._resolve = resolve
        self.missing: list[str] = []
        self.unchecked: list[str] = []
        self.notes: list[str] = []
        self._paints: dict[str, _Paint] = {}
        # A material may be used before the element that defines it.
        for material in root.iter("material"):
            paint = _paint(material)
            if paint is not None:
                self._paints[material.get("name", "")] = paint

    def of(self, link: Xml.Element, name: str) -> tuple[tuple[Shape, ...], tuple[Shape, ...]]:
        """Return the shapes of a link that are drawn, and other shapes for collision checks, if any.

        Both are in the link's frame. The second is empty if the drawn shapes are checked too.
        """
        collisions = link.findall("collision")
        drawn = [
            self._shape(element, f"link {name!r} visual", checked=not collisions)
            for element in link.findall("visual")
        ]
        checked = [self._shape(element, f"link {name!r} collision", checked=True) for element in collisions]
        shapes, collision = (tuple(each for each in some if each is not None) for some in (drawn, checked))
        if not drawn:
            return collision, ()
        same = len(shapes) == len(collision) and all(map(_same, shapes, collision))
        return shapes, () if same else collision

    def _shape(self, element: Xml.Element, what: str, *, checked: bool) -> Shape | None:
        placement = origin(element, what)
        geometry = element.find("geometry")
        found = next(iter(geometry), None) if geometry is not None else None
        if found is None:
            self.notes.append(f"{what}: has no geometry")
            return None
        material = element.find("material")
        color, opacity = None, None
        if material is not None:
            paint = _paint(material) or self._paints.get(material.get("name", ""))
            color, opacity = paint or (None, None)
        if found.tag == "mesh":
            shape = self._file_shape(found, what, placement, color, opacity)
            if shape is None and checked:
                self.unchecked.append(found.get("filename", ""))
            return shape
        solid = _solid(found, f"{what} {found.tag}", rounder=_ROUNDER if element.tag == "collision" else 1.0)
        if solid is None:
            self.notes.append(f"{what}: shape {found.tag} is not supported; left out")
            return None
        vertices, normals, triangles = creased(*solid, pi / 6)
        part = Part("", Material(), vertices, normals, triangles)
        return Shape(Geometry((part,)), placement, color, opacity)

    def _file_shape(
        self,
        element: Xml.Element,
        what: str,
        placement: FloatArray,
        color: tuple[float, float, float] | None,
        opacity: float | None,
    ) -> Shape | None:
        address = element.get("filename", "")
        if not address:
            raise WrongElement(f"{what} mesh: has no filename")
        path = self._resolve(address)
        if path is None:
            if address not in self.missing:
                self.missing.append(address)
            return None
        if not is_exact(path, address):
            note = f"mesh {address!r}: is taken for {path.parent.name}/{path.name}"
            self.notes += [] if note in self.notes else [note]
        # As in ROS, the colour applies only to formats without colours.
        if path.suffix.lower() != ".stl":
            color, opacity = None, None
        scale = numbers(element, "scale", 3, f"{what} mesh", "1 1 1")
        return Shape(path, placement @ np.diag([*scale, 1.0]), color, opacity, in_stated_unit=True)


def _same(one: Shape, other: Shape) -> bool:
    """Return whether two shapes have the same geometry; colours may differ."""
    if not np.array_equal(one.shape_to_link, other.shape_to_link):
        return False
    if isinstance(one.source, Geometry) and isinstance(other.source, Geometry):
        (one_part,), (other_part,) = one.source.parts, other.source.parts
        return np.array_equal(one_part.vertices, other_part.vertices)
    return one.source == other.source


def _paint(material: Xml.Element) -> _Paint | None:
    color = material.find("color")
    if color is None:
        return None
    name = f"material {material.get('name', '')!r} color"
    red, green, blue, opacity = np.clip(numbers(color, "rgba", 4, name, "0.8 0.8 0.8 1"), 0, 1).tolist()
    return (red, green, blue), opacity


def _solid(element: Xml.Element, what: str, *, rounder: float) -> Solid | None:
    """Return a box, sphere, cylinder or capsule; None for any other element.

    Args:
        rounder: Factor for the radius of round shapes.
    """
    match element.tag:
        case "box":
            half = np.array(numbers(element, "size", 3, what, "")) / 2
            return box(-half, half)
        case "sphere":
            (radius,) = numbers(element, "radius", 1, what, "")
            return ball(radius * rounder, _ROUND)
        case "cylinder" | "capsule":
            (radius,), (length,) = (numbers(element, key, 1, what, "") for key in ("radius", "length"))
            return turned(
                _round_profile(radius * rounder, length / 2, capsule=element.tag == "capsule"), _ROUND
            )
        case _:
            return None


def _round_profile(radius: float, half: float, *, capsule: bool) -> list[tuple[float, float]]:
    if not capsule:
        return [(0.0, -half), (radius, -half), (radius, half), (0.0, half)]
    angles = np.linspace(0, pi / 2, 9)[1:]
    upper = [(float(radius * np.sin(angle)), float(half + radius * np.cos(angle))) for angle in angles]
    return [
        (0.0, -half - radius),
        *((r, -z) for r, z in upper),
        *reversed(upper),
        (0.0, half + radius),
    ]
