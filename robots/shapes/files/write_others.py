"""Writers of STL, OBJ and PLY files, in the shape's units and axes."""

from collections.abc import Iterator

import numpy as np

from robots.shapes.geometry import FloatArray, Geometry, Material, Part
from robots.shapes.geometry import unit as unit_vectors

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])
_VERTEX = np.dtype([("position", "<f4", 3), ("normal", "<f4", 3), ("color", "u1", 4)])
_FACE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])


def write_stl(geometry: Geometry) -> bytes:
    """Return a binary .stl file, which has the shape only."""
    corners = np.concatenate(
        [np.zeros((0, 3, 3)), *(part.vertices[part.triangles] for part in geometry.parts)], dtype=np.float64
    )
    facets = np.zeros(len(corners), dtype=_FACET)
    facets["corners"] = corners
    facets["normal"] = unit_vectors(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    # The header must not begin with "solid", which marks a text STL.
    return b"robomesh".ljust(80) + np.uint32(len(facets)).tobytes() + facets.tobytes()


def write_ply(geometry: Geometry) -> bytes:
    """Return a binary .ply file with the shape and the colours, materials' colours given to vertices."""
    vertices, faces, count = [], [], 0
    for part in geometry.parts:
        rows = np.zeros(len(part.vertices), dtype=_VERTEX)
        rows["position"], rows["normal"] = part.vertices, part.normals
        rows["color"] = np.round(_colors(part) * 255)
        cut = np.zeros(len(part.triangles), dtype=_FACE)
        cut["count"], cut["corners"] = 3, part.triangles + count
        vertices.append(rows.tobytes())
        faces.append(cut.tobytes())
        count += len(rows)
    header = "\n".join(
        [
            "ply",
            "format binary_little_endian 1.0",
            f"element vertex {count}",
            *(f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")),
            *(f"property uchar {name}" for name in ("red", "green", "blue", "alpha")),
            f"element face {geometry.triangle_count}",
            "property list uchar int vertex_indices",
            "end_header\n",
        ]
    )
    return header.encode() + b"".join(vertices) + b"".join(faces)


def _colors(part: Part) -> FloatArray:
    if part.colors is not None:
        return part.colors
    return np.tile([*part.material.diffuse, 1 - part.material.transparency], (len(part.vertices), 1))


def write_obj(geometry: Geometry, library: str) -> tuple[str, str]:
    """Return the text of an .obj file, and the text of its materials for the .mtl file named `library`."""
    names: dict[Material, str] = {}
    for part in geometry.parts:
        base = "_".join(part.material.name.split()) or "material"
        taken = set(names.values())
        name = next(n for n in _numbered(base) if n not in taken) if part.material not in names else ""
        names.setdefault(part.material, name)
    lines = [f"mtllib {library}"]
    count = 1
    for number, part in enumerate(geometry.parts):
        lines.append(f"o {'_'.join(part.name.split()) or f'part{number}'}")
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in part.vertices.tolist()]
        lines += [f"vn {x:.6g} {y:.6g} {z:.6g}" for x, y, z in part.normals.tolist()]
        lines.append(f"usemtl {names[part.material]}")
        lines += [f"f {a}//{a} {b}//{b} {c}//{c}" for a, b, c in (part.triangles + count).tolist()]
        count += len(part.vertices)
    materials = [line for material, name in names.items() for line in _material(material, name)]
    return "\n".join(lines) + "\n", "\n".join(materials) + "\n"


def _numbered(base: str) -> Iterator[str]:
    yield base
    number = 2
    while True:
        yield f"{base}_{number}"
        number += 1


def _material(material: Material, name: str) -> Iterator[str]:
    yield f"newmtl {name}"
    for key, color in (("Kd", material.diffuse), ("Ks", material.specular), ("Ke", material.emissive)):
        yield f"{key} {' '.join(f'{value:.6g}' for value in color)}"
    yield f"Ns {material.shininess * 128:.6g}"
    yield f"d {1 - material.transparency:.6g}"
    if material.texture:
        yield f"map_Kd {material.texture}"
