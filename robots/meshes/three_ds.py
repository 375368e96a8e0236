"""3DS files to meshes.

    file    = chunk 0x4D4D
    chunk   = id:uint16 length:uint32 ...           length counts these 6 bytes too; little-endian

    4D4D main
    ├── 3D3D editor
    │   ├── 0100 unit in inches, of no use: nobody sets it
    │   ├── AFFF material ── A000 name, A020 diffuse, A030 specular, A040 shininess, A050 transparency,
    │   │                    A081 two-sided; each colour is 0010 (floats) or 0011 (bytes), 0012/0013 gamma
    │   └── 4000 object: name, then 4100 mesh ── 4110 vertices, 4120 faces ── 4130 faces of a material
    │                                                                     └── 4150 smoothing groups
    │                                        └── 4160 local frame
    └── B000 key frames

Vertices stand where they are drawn already. The local frame and the key frames say how an object was
built and how it moves; applying them to a still picture (as some readers do) puts it in the wrong place.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from robots.errors import MeshError
from robots.meshes.mesh import Color, FloatArray, IndexArray, Material, Mesh, Part
from robots.meshes.normals import grouped

_HEADER = struct.Struct("<HI")
_MAIN, _EDITOR, _OBJECT, _MESH, _MATERIAL = 0x4D4D, 0x3D3D, 0x4000, 0x4100, 0xAFFF
_VERTICES, _FACES, _FACE_MATERIAL, _SMOOTHING, _LOCAL_FRAME = 0x4110, 0x4120, 0x4130, 0x4150, 0x4160


@dataclass(frozen=True)
class _Chunk:
    id: int
    start: int  # of its data
    end: int


@dataclass
class _Object:
    name: str
    vertices: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    triangles: IndexArray = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    groups: IndexArray | None = None
    materials: list[tuple[str, IndexArray]] = field(default_factory=list)
    mirrored: bool = False


def read_3ds(path: Path) -> Mesh:
    """The triangles of a .3ds file, in its own units and axes.

    Raises:
        MeshError: If it is not a 3DS file, or a broken one, with the byte.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MeshError(path, f"cannot be read: {error.strerror}") from error
    return _Reader(path, data).mesh()


class _Reader:
    def __init__(self, path: Path, data: bytes) -> None:
        self.path = path
        self.data = data
        self.warnings: list[str] = []

    def mesh(self) -> Mesh:
        if len(self.data) < _HEADER.size or _HEADER.unpack_from(self.data)[0] != _MAIN:
            raise MeshError(self.path, "is not a 3DS file: it does not begin with chunk 4D4D")
        materials: dict[str, Material] = {}
        two_sided: set[str] = set()
        objects: list[_Object] = []
        for main in self.chunks(0, len(self.data)):
            if main.id != _MAIN:
                break  # what follows the main chunk is not the file's
            for editor in self.chunks(main.start, main.end):
                if editor.id != _EDITOR:
                    continue
                for chunk in self.chunks(editor.start, editor.end):
                    if chunk.id == _MATERIAL:
                        material, both = self.material(chunk)
                        materials[material.name] = material
                        if both:
                            two_sided.add(material.name)
                    elif chunk.id == _OBJECT:
                        objects.extend(self.object(chunk))
        parts = tuple(part for found in objects for part in self.parts(found, materials, two_sided))
        return Mesh(parts, tuple(self.warnings))

    def chunks(self, start: int, end: int) -> Iterator[_Chunk]:
        while end - start >= _HEADER.size:
            identity, length = _HEADER.unpack_from(self.data, start)
            if length < _HEADER.size or start + length > end:
                raise self.error(
                    start, f"chunk {identity:04X} of {length} bytes; {end - start} are left there"
                )
            yield _Chunk(identity, start + _HEADER.size, start + length)
            start += length

    def object(self, chunk: _Chunk) -> Iterator[_Object]:
        name, start = self.text(chunk.start, chunk.end)
        for child in self.chunks(start, chunk.end):
            if child.id == _MESH:
                yield self.triangles(name, child)

    def triangles(self, name: str, chunk: _Chunk) -> _Object:
        found = _Object(name)
        for child in self.chunks(chunk.start, chunk.end):
            if child.id == _VERTICES:
                found.vertices, _ = self.array(child.start, child.end, "<f4", 3)
            elif child.id == _FACES:
                self.faces(found, child)
            elif child.id == _LOCAL_FRAME and child.end - child.start >= 36:
                frame = np.frombuffer(self.data, "<f4", 9, child.start).reshape(3, 3)
                found.mirrored = bool(np.linalg.det(frame.astype(np.float64)) < 0)
        wrong = found.triangles >= len(found.vertices)
        if wrong.any():
            number = int(found.triangles[wrong][0])
            raise self.error(
                chunk.start, f"object {name!r}: vertex {number}; there are {len(found.vertices)}"
            )
        if not np.isfinite(found.vertices).all():
            raise self.error(chunk.start, f"object {name!r}: a vertex that is not finite")
        return found

    def faces(self, found: _Object, chunk: _Chunk) -> None:
        corners, after = self.array(chunk.start, chunk.end, "<u2", 4)
        found.triangles = corners[:, :3].astype(np.int64)  # the fourth holds edge flags
        for child in self.chunks(after, chunk.end):
            if child.id == _FACE_MATERIAL:
                name, start = self.text(child.start, child.end)
                faces, _ = self.array(start, child.end, "<u2", 1)
                numbers = faces.ravel().astype(np.int64)
                if len(numbers) and numbers.max() >= len(corners):
                    raise self.error(start, f"face {numbers.max()}; there are {len(corners)}")
                found.materials.append((name, numbers))
            elif child.id == _SMOOTHING:
                count = (child.end - child.start) // 4
                if count >= len(corners):
                    groups = np.frombuffer(self.data, "<u4", len(corners), child.start)
                    found.groups = groups.astype(np.int64)

    def array(self, start: int, end: int, kind: str, width: int) -> tuple[FloatArray, int]:
        """A count (uint16) and as many rows; and where they end."""
        if end - start < 2:
            raise self.error(start, "a list without its count")
        (count,) = struct.unpack_from("<H", self.data, start)
        size = count * width * np.dtype(kind).itemsize
        if start + 2 + size > end:
            raise self.error(start, f"a list of {count} that needs {size} bytes; {end - start - 2} are there")
        flat = np.frombuffer(self.data, kind, count * width, start + 2)
        return flat.reshape(count, width).astype(np.float64), start + 2 + size

    def text(self, start: int, end: int) -> tuple[str, int]:
        """A string that ends with a zero byte, and where it ends."""
        zero = self.data.find(b"\0", start, end)
        if zero < 0:
            raise self.error(start, "a name that does not end")
        return self.data[start:zero].decode("latin-1"), zero + 1

    def material(self, chunk: _Chunk) -> tuple[Material, bool]:
        material, two_sided = Material(), False
        for child in self.chunks(chunk.start, chunk.end):
            if child.id == 0xA000:
                material = replace(material, name=self.text(child.start, child.end)[0])
            elif child.id == 0xA020:
                material = replace(material, diffuse=self.color(child, material.diffuse))
            elif child.id == 0xA030:
                material = replace(material, specular=self.color(child, material.specular))
            elif child.id == 0xA040:
                material = replace(material, shininess=self.fraction(child))
            elif child.id == 0xA050:
                material = replace(material, transparency=self.fraction(child))
            elif child.id == 0xA081:
                two_sided = True
        return material, two_sided

    def color(self, chunk: _Chunk, default: Color) -> Color:
        """The first of the colours in a chunk: the one without gamma stands first."""
        for child in self.chunks(chunk.start, chunk.end):
            size = child.end - child.start
            if child.id in (0x0010, 0x0013) and size >= 12:
                red, green, blue = np.clip(np.frombuffer(self.data, "<f4", 3, child.start), 0, 1).tolist()
                return red, green, blue
            if child.id in (0x0011, 0x0012) and size >= 3:
                red, green, blue = (self.data[child.start + k] / 255 for k in range(3))
                return red, green, blue
        return default

    def fraction(self, chunk: _Chunk) -> float:
        for child in self.chunks(chunk.start, chunk.end):
            size = child.end - child.start
            if child.id == 0x0030 and size >= 2:
                return min(max(float(struct.unpack_from("<h", self.data, child.start)[0]) / 100, 0.0), 1.0)
            if child.id == 0x0031 and size >= 4:
                return min(max(float(struct.unpack_from("<f", self.data, child.start)[0]), 0.0), 1.0)
        return 0.0

    def parts(self, found: _Object, materials: dict[str, Material], two_sided: set[str]) -> Iterator[Part]:
        if not len(found.triangles):
            return
        corners = found.triangles[:, ::-1] if found.mirrored else found.triangles
        groups = found.groups if found.groups is not None else np.zeros(len(corners), dtype=np.int64)
        vertices, normals, triangles = grouped(found.vertices, corners, groups)
        unpainted = np.ones(len(triangles), dtype=bool)
        runs = []
        for name, numbers in found.materials:
            if name not in materials:
                self.warnings.append(f"object {found.name!r}: no material {name!r} in the file; drawn grey")
            runs.append((name, numbers[unpainted[numbers]]))
            unpainted[numbers] = False
        runs.append(("", np.flatnonzero(unpainted)))
        for name, numbers in runs:
            if not len(numbers):
                continue
            used, faces = np.unique(triangles[numbers], return_inverse=True)
            yield Part(
                name=found.name,
                material=materials.get(name, Material(name=name)),
                vertices=vertices[used],
                normals=normals[used],
                triangles=faces.reshape(-1, 3).astype(np.int64),
                two_sided=name in two_sided,
            )

    def error(self, position: int, reason: str) -> MeshError:
        return MeshError(self.path, reason, place=f"byte {position}")
