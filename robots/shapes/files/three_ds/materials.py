"""The materials of a 3DS file.

AFFF ── A000 name, A020 diffuse, A030 specular, A040 shininess, A050 transparency,
        A080 / A084 self-illuminated, A081 two-sided, A200 texture ── A300 its file's name
colour   = 0010 (3 floats) | 0011 (3 bytes), both sRGB | 0012 (bytes) | 0013 (floats), both linear
fraction = 0030 (percent, int16) | 0031 (float)
"""

import struct
from dataclasses import dataclass, field, replace

import numpy as np

from robots.shapes.files.three_ds.chunks import Chunk, Source
from robots.shapes.geometry import Color, Material

_FLOATS, _BYTES = (0x0010, 0x0013), (0x0011, 0x0012)
_LINEAR = (0x0012, 0x0013)


@dataclass(frozen=True)
class Surface:
    """A material, and whether both sides of its faces are drawn."""

    material: Material = field(default_factory=Material)
    two_sided: bool = False


def surface_of(source: Source, chunk: Chunk) -> Surface:
    """Return a material chunk's material, with defaults for missing properties."""
    material, two_sided, glow = Material(), False, 0.0
    for child in source.chunks(chunk.start, chunk.end):
        if child.id == 0xA000:
            material = replace(material, name=source.text(child.start, child.end)[0])
        elif child.id == 0xA020:
            material = replace(material, diffuse=_color(source, child, material.diffuse))
        elif child.id == 0xA030:
            material = replace(material, specular=_color(source, child, material.specular))
        elif child.id == 0xA040:
            material = replace(material, shininess=_fraction(source, child, material.shininess))
        elif child.id == 0xA050:
            material = replace(material, transparency=_fraction(source, child, 0.0))
        elif child.id == 0xA080:
            glow = 1.0
        elif child.id == 0xA084:
            glow = _fraction(source, child, 0.0)
        elif child.id == 0xA081:
            two_sided = True
        elif child.id == 0xA200:
            material = replace(material, texture=_texture(source, child))
    red, green, blue = (value * glow for value in material.diffuse)
    return Surface(replace(material, emissive=(red, green, blue)), two_sided)


def _color(source: Source, chunk: Chunk, default: Color) -> Color:
    """Return the sRGB colour if there is one, otherwise the linear one."""
    found: dict[bool, Color] = {}
    for child in source.chunks(chunk.start, chunk.end):
        size = child.end - child.start
        values = None
        if child.id in _FLOATS and size >= 12:
            values = source.numbers(child.start, "<f4", 3)
        elif child.id in _BYTES and size >= 3:
            values = source.numbers(child.start, "u1", 3) / 255
        if values is not None:
            red, green, blue = np.clip(np.nan_to_num(values), 0, 1).tolist()
            found.setdefault(child.id in _LINEAR, (red, green, blue))
    return found.get(False, found.get(True, default))


def _fraction(source: Source, chunk: Chunk, default: float) -> float:
    for child in source.chunks(chunk.start, chunk.end):
        size = child.end - child.start
        if child.id == 0x0030 and size >= 2:
            return min(max(float(struct.unpack_from("<h", source.data, child.start)[0]) / 100, 0.0), 1.0)
        if child.id == 0x0031 and size >= 4:
            (value,) = struct.unpack_from("<f", source.data, child.start)
            return min(max(float(value), 0.0), 1.0) if value == value else default
    return default


def _texture(source: Source, chunk: Chunk) -> str:
    for child in source.chunks(chunk.start, chunk.end):
        if child.id == 0xA300:
            return source.text(child.start, child.end)[0]
    return ""
