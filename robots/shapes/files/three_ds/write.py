"""Writer of 3DS files: an object for each part. Split vertices keep edges sharp; readers compute normals."""

import struct

import numpy as np

from robots.shapes.geometry import Color, Geometry, Material, Part

# 3DS counts vertices and faces in 16 bits.
_MOST = 65535


def write_3ds(geometry: Geometry) -> bytes:
    """Return the content of a .3ds file; the same shape gives the same bytes.

    Raises:
        ValueError: If a part has more than 65,535 vertices or triangles.
    """
    materials = {part.material.name or "default": part for part in geometry.parts}
    version = _chunk(0x3D3E, struct.pack("<I", 3))
    blocks = [_material(name, part.material, part.two_sided) for name, part in materials.items()]
    objects = [_object(f"part{number}", part) for number, part in enumerate(geometry.parts)]
    editor = _chunk(0x3D3D, version, *blocks, *objects)
    return _chunk(0x4D4D, _chunk(0x0002, struct.pack("<I", 3)), editor)


def _chunk(identity: int, *contents: bytes) -> bytes:
    content = b"".join(contents)
    return struct.pack("<HI", identity, len(content) + 6) + content


def _text(text: str) -> bytes:
    return text.encode("latin-1", errors="replace") + b"\0"


def _material(name: str, material: Material, two_sided: bool) -> bytes:
    return _chunk(
        0xAFFF,
        _chunk(0xA000, _text(name)),
        _chunk(0xA010, _color((0.1, 0.1, 0.1))),
        _chunk(0xA020, _color(material.diffuse)),
        _chunk(0xA030, _color(material.specular)),
        _chunk(0xA040, _percent(material.shininess)),
        _chunk(0xA050, _percent(material.transparency)),
        _chunk(0xA081) if two_sided else b"",
    )


def _color(color: Color) -> bytes:
    return _chunk(0x0011, bytes(round(value * 255) for value in color))


def _percent(fraction: float) -> bytes:
    return _chunk(0x0030, struct.pack("<h", round(fraction * 100)))


def _object(name: str, part: Part) -> bytes:
    if max(len(part.vertices), len(part.triangles)) > _MOST:
        raise ValueError(f"part {part.name!r} has more than {_MOST} vertices or triangles, the limit of 3DS")
    count = len(part.triangles)
    corners = np.column_stack([part.triangles, np.full(count, 7)]).astype("<u2")  # 7: all three edges seen
    faces = _chunk(
        0x4120,
        struct.pack("<H", count) + corners.tobytes(),
        _chunk(
            0x4130,
            _text(part.material.name or "default")
            + struct.pack("<H", count)
            + np.arange(count, dtype="<u2").tobytes(),
        ),
        _chunk(0x4150, np.ones(count, dtype="<u4").tobytes()),
    )
    vertices = struct.pack("<H", len(part.vertices)) + part.vertices.astype("<f4").tobytes()
    frame = np.eye(4, 3, dtype="<f4").tobytes()
    return _chunk(0x4000, _text(name), _chunk(0x4100, _chunk(0x4110, vertices), _chunk(0x4160, frame), faces))
