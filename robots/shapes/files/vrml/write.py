"""Writer of VRML 2.0 text: a Shape for each part, with normals; materials are DEFined by name."""

import re
from collections.abc import Iterator

from robots.shapes.geometry import FloatArray, Geometry, IndexArray, Material, Part

_DECIMALS = 3


def write_vrml(geometry: Geometry, *, decimals: int = _DECIMALS) -> str:
    """Return the text of a .wrl file; the same shape gives the same text.

    Args:
        decimals: Decimals of vertex coordinates.
    """
    return "\n".join(["#VRML V2.0 utf8", *_lines(geometry, decimals)]) + "\n"


def _lines(geometry: Geometry, decimals: int) -> Iterator[str]:
    written: dict[Material, str] = {}
    for part in geometry.parts:
        yield "Shape {"
        yield from _appearance(part.material, written)
        yield from _face_set(part, decimals)
        yield "}"


def _appearance(material: Material, written: dict[Material, str]) -> Iterator[str]:
    if material in written:
        yield f"  appearance Appearance {{ material USE {written[material]} }}"
        return
    name = _node_name(material.name, taken=set(written.values()))
    written[material] = name
    yield f"  appearance Appearance {{ material DEF {name} Material {{"
    for key, color in [
        ("diffuseColor", material.diffuse),
        ("specularColor", material.specular),
        ("emissiveColor", material.emissive),
    ]:
        yield f"    {key} {' '.join(_short(value, 4) for value in color)}"
    yield f"    shininess {_short(material.shininess, 4)}"
    yield f"    transparency {_short(material.transparency, 4)}"
    yield "  } }"


def _face_set(part: Part, decimals: int) -> Iterator[str]:
    yield "  geometry IndexedFaceSet {"
    if part.two_sided:
        yield "    solid FALSE"
    yield f"    coord Coordinate {{ point [\n{_rows(part.vertices, decimals)}\n    ] }}"
    yield f"    normal Normal {{ vector [\n{_rows(part.normals, _DECIMALS)}\n    ] }}"
    # Without normalIndex, coordIndex selects the normals too.
    yield f"    coordIndex [\n{_faces(part.triangles)}\n    ]"
    yield "  }"


def _rows(array: FloatArray, decimals: int) -> str:
    rows = [" ".join(_short(value, decimals) for value in row) for row in array.tolist()]
    return "\n".join(", ".join(rows[start : start + 4]) + "," for start in range(0, len(rows), 4))


def _faces(triangles: IndexArray) -> str:
    rows = [f"{a} {b} {c} -1" for a, b, c in triangles.tolist()]
    return "\n".join(", ".join(rows[start : start + 6]) + "," for start in range(0, len(rows), 6))


def _short(value: float, decimals: int) -> str:
    text = f"{value:.{decimals}f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def _node_name(name: str, taken: set[str]) -> str:
    """Return the closest name that VRML allows and that is not taken."""
    base = re.sub(r"[\x00-\x20\x22\x23\x27\x2b-\x2e\x5b-\x5d\x7b\x7d\x7f]", "_", name) or "material"
    if base[0].isdigit():
        base = f"m{base}"
    found, number = base, 2
    while found in taken:
        found, number = f"{base}_{number}", number + 1
    return found
