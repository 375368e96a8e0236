"""What the links of a URDF look like: their visuals, or their collision shapes where there is none."""

import xml.etree.ElementTree as Xml
from math import pi

import numpy as np

from robots.meshes.mesh import Material, Mesh, Part
from robots.meshes.normals import creased
from robots.meshes.solids import Solid, ball, box, turned
from robots.poses import FloatArray
from robots.tree import Shape
from robots.urdf.files import Resolve
from robots.urdf.values import WrongElement, numbers, origin

_ROUND = 32
_Paint = tuple[tuple[float, float, float], float]


class Shapes:
    """The shapes of one URDF while it is read.

    Attributes:
        missing: Mesh files that were not found, as the file names them.
    """

    def __init__(self, root: Xml.Element, resolve: Resolve) -> None:
        self._resolve = resolve
        self.missing: list[str] = []
        self.notes: list[str] = []
        self._paints: dict[str, _Paint] = {}
        # A material may be named before the element that says what it is.
        for material in root.iter("material"):
            paint = _paint(material)
            if paint is not None:
                self._paints[material.get("name", "")] = paint

    def of(self, link: Xml.Element, name: str) -> tuple[Shape, ...]:
        """The shapes of a link, in its own frame."""
        for kind in ("visual", "collision"):
            shapes = [self._shape(element, f"link {name!r} {kind}") for element in link.findall(kind)]
            if shapes:
                return tuple(shape for shape in shapes if shape is not None)
        return ()

    def _shape(self, element: Xml.Element, what: str) -> Shape | None:
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
            return self._mesh(found, what, placement, color, opacity)
        solid = _solid(found, f"{what} {found.tag}")
        if solid is None:
            self.notes.append(f"{what}: {found.tag} is no shape that is drawn; left out")
            return None
        vertices, normals, triangles = creased(*solid, pi / 6)
        mesh = Mesh(parts=(Part("", Material(), vertices, normals, triangles),))
        return Shape(mesh, placement, color, opacity)

    def _mesh(
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
        # As in ROS: the colour is for files that have none of their own.
        if path.suffix.lower() != ".stl":
            color, opacity = None, None
        scale = numbers(element, "scale", 3, f"{what} mesh", "1 1 1")
        # The unit that COLLADA states counts, its upward axis does not: as ROS has it.
        return Shape(path, placement @ np.diag([*scale, 1.0]), color, opacity, in_stated_unit=True)


def _paint(material: Xml.Element) -> _Paint | None:
    color = material.find("color")
    if color is None:
        return None
    name = f"material {material.get('name', '')!r} color"
    red, green, blue, opacity = np.clip(numbers(color, "rgba", 4, name, "0.8 0.8 0.8 1"), 0, 1).tolist()
    return (red, green, blue), opacity


def _solid(element: Xml.Element, what: str) -> Solid | None:
    match element.tag:
        case "box":
            half = np.array(numbers(element, "size", 3, what, "")) / 2
            return box(-half, half)
        case "sphere":
            (radius,) = numbers(element, "radius", 1, what, "")
            return ball(radius, _ROUND)
        case "cylinder" | "capsule":
            (radius,), (length,) = (numbers(element, key, 1, what, "") for key in ("radius", "length"))
            return turned(_round_profile(radius, length / 2, capsule=element.tag == "capsule"), _ROUND)
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
