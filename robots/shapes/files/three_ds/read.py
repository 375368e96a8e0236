"""Reader of 3DS files.

    4D4D main
    ├── 3D3D editor
    │   ├── 0100 unit in inches, ignored: no program sets it
    │   ├── AFFF material
    │   └── 4000 object: name, then 4100 mesh ── 4110 vertices, 4120 faces ── 4130 faces of a material
    │                                                                     └── 4150 smoothing groups
    │                                        └── 4160 local frame
    └── B000 key frames

Vertices are already in place. The local frame and the key frames say how an object was built and how it
moves; some readers apply them to a static shape, which puts it in the wrong place.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from robots.schema.errors import ShapeError
from robots.shapes.files.three_ds.chunks import Chunk, Source
from robots.shapes.files.three_ds.keyframes import nodes_of
from robots.shapes.files.three_ds.materials import Surface, surface_of
from robots.shapes.geometry import FloatArray, Geometry, IndexArray, Material, Node, Part
from robots.shapes.normals import grouped

_MAIN, _EDITOR, _OBJECT, _MESH, _MATERIAL, _KEYFRAMES = 0x4D4D, 0x3D3D, 0x4000, 0x4100, 0xAFFF, 0xB000
_VERTICES, _FACES, _FACE_MATERIAL, _SMOOTHING, _LOCAL_FRAME = 0x4110, 0x4120, 0x4130, 0x4150, 0x4160


@dataclass
class _Object:
    name: str
    vertices: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    triangles: IndexArray = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    groups: IndexArray | None = None
    materials: list[tuple[str, IndexArray]] = field(default_factory=list)
    mirrored: bool = False


def read_3ds(path: Path) -> Geometry:
    """Return the triangles and the hierarchy of a .3ds file, in the file's units and axes.

    Each node's origin is its object's pivot; parts have their object's name.

    Raises:
        ShapeError: If it is not a 3DS file, or is damaged; the error has the byte.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ShapeError(path, f"cannot be read: {error.strerror}") from error
    if len(data) < 6 or data[:2] != b"MM":
        raise ShapeError(path, "is not a 3DS file: it does not begin with chunk 4D4D")
    source = Source(path, data)
    surfaces: dict[str, Surface] = {}
    objects: list[_Object] = []
    nodes: tuple[Node, ...] = ()
    main = next(source.chunks(0, len(data), lenient=True), None)
    # Bytes after the main chunk do not belong to the file.
    for section in source.chunks(main.start, main.end, lenient=True) if main is not None else ():
        if section.id == _EDITOR:
            for chunk in source.chunks(section.start, section.end, lenient=True):
                if chunk.id == _MATERIAL:
                    surface = surface_of(source, chunk)
                    surfaces[surface.material.name] = surface
                elif chunk.id == _OBJECT:
                    objects.extend(_objects(source, chunk))
        elif section.id == _KEYFRAMES:
            try:
                nodes = nodes_of(source, section)
            except ShapeError as error:  # the triangles do not depend on the hierarchy
                source.warn(f"{error.place}: {error.reason}; the hierarchy is left out")
    parts = tuple(part for found in objects for part in _parts(source, found, surfaces))
    if not parts:
        if source.warnings:
            raise ShapeError(path, source.warnings[0])
        source.warn("has no triangles")
    textures = sorted({part.material.texture for part in parts} - {""})
    if textures:
        source.warn(f"textures are kept by name, not drawn: {', '.join(textures[:10])}")
    return Geometry(parts, warnings=tuple(source.warnings), nodes=nodes)


def _objects(source: Source, chunk: Chunk) -> Iterator[_Object]:
    name, start = source.text(chunk.start, chunk.end)
    for child in source.chunks(start, chunk.end):
        if child.id == _MESH:
            yield _object(source, name, child)


def _object(source: Source, name: str, chunk: Chunk) -> _Object:
    found = _Object(name)
    for child in source.chunks(chunk.start, chunk.end):
        if child.id == _VERTICES:
            found.vertices, _ = source.array(child.start, child.end, "<f4", 3)
        elif child.id == _FACES:
            _faces(source, found, child)
        elif child.id == _LOCAL_FRAME and child.end - child.start >= 36:
            frame = source.numbers(child.start, "<f4", 9).reshape(3, 3)
            found.mirrored = bool(np.isfinite(frame).all() and np.linalg.det(frame) < 0)
    wrong = found.triangles >= len(found.vertices)
    if wrong.any():
        number = int(found.triangles[wrong][0])
        raise source.error(chunk.start, f"object {name!r}: vertex {number}; there are {len(found.vertices)}")
    if not np.isfinite(found.vertices[found.triangles.ravel()]).all():
        raise source.error(chunk.start, f"object {name!r}: a vertex has a non-finite coordinate")
    return found


def _faces(source: Source, found: _Object, chunk: Chunk) -> None:
    corners, after = source.array(chunk.start, chunk.end, "<u2", 4)
    found.triangles = corners[:, :3].astype(np.int64)  # the fourth holds edge flags
    found.materials, found.groups = [], None
    for child in source.chunks(after, chunk.end):
        if child.id == _FACE_MATERIAL:
            name, start = source.text(child.start, child.end)
            faces, _ = source.array(start, child.end, "<u2", 1)
            numbers = np.unique(faces.astype(np.int64))
            if len(numbers) and numbers[-1] >= len(corners):
                raise source.error(start, f"face {numbers[-1]}; there are {len(corners)}")
            found.materials.append((name, numbers))
        elif child.id == _SMOOTHING and child.end - child.start >= 4 * len(corners):
            found.groups = np.frombuffer(source.data, "<u4", len(corners), child.start).astype(np.int64)


def _parts(source: Source, found: _Object, surfaces: dict[str, Surface]) -> Iterator[Part]:
    if not len(found.triangles):
        return
    inside_out = found.mirrored and _volume(found.vertices, found.triangles) < 0
    corners = found.triangles[:, ::-1] if inside_out else found.triangles
    groups = found.groups if found.groups is not None else np.zeros(len(corners), dtype=np.int64)
    vertices, normals, triangles = grouped(found.vertices, corners, groups)
    unpainted = np.ones(len(triangles), dtype=bool)
    runs = []
    for name, numbers in found.materials:
        if name not in surfaces:
            source.warn(f"object {found.name!r}: no material {name!r} in the file; drawn grey")
        runs.append((name, numbers[unpainted[numbers]]))
        unpainted[numbers] = False
    runs.append(("", np.flatnonzero(unpainted)))
    for name, numbers in runs:
        if not len(numbers):
            continue
        used, faces = np.unique(triangles[numbers], return_inverse=True)
        surface = surfaces.get(name, Surface(Material(name=name)))
        yield Part(
            name=found.name,
            material=surface.material,
            vertices=vertices[used],
            normals=normals[used],
            triangles=faces.reshape(-1, 3).astype(np.int64),
            two_sided=surface.two_sided,
        )


def _volume(vertices: FloatArray, triangles: IndexArray) -> float:
    """Return six times the volume of a closed surface; negative if it is inside out.

    Some programs reverse the faces of a mirrored object, others do not.
    """
    a, b, c = (vertices[triangles[:, corner]] - vertices.mean(axis=0) for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)))
