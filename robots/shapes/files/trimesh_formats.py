"""Reader of STL, OBJ, PLY and DAE files, based on trimesh.

Every triangle of the file is kept and placed by the file's nodes, in the file's axes and units. Missing
normals are computed, smooth up to 30 degrees.
"""

import importlib
import io
import logging
import warnings as warnings_module
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from robots.schema.errors import ShapeError
from robots.shapes.files.declared_size import Declared, read_declared
from robots.shapes.geometry import (
    Color,
    FloatArray,
    Geometry,
    IndexArray,
    Material,
    Part,
    Wire,
    placed,
    transformed,
    welded,
)
from robots.shapes.normals import creased

_CREASE = np.radians(30)


def read_trimesh(path: Path, *, kind: str = "") -> Geometry:
    """Return the content of an STL, OBJ, PLY or DAE file, in the file's units and axes.

    Other files that it names are read below its folder only; files elsewhere count as missing.

    Args:
        kind: The format as a file ending ("stl"); the file's ending by default.

    Raises:
        ShapeError: If the file is not of that format, or has a vertex that is not finite.
    """
    kind = kind or path.suffix.lower().lstrip(".")
    declared = read_declared(path, kind)
    geometry = geometry_of(path, _drawn(path, kind, declared), declared)
    if not geometry.parts and not geometry.wires and kind == "stl":
        raise ShapeError(path, "is not an STL file: it has no facet")
    return geometry


def geometry_of(path: Path, found: Sequence[Part | Wire], declared: Declared) -> Geometry:
    """Return the geometry of a file's parts and wires, without those that draw nothing.

    Raises:
        ShapeError: If a vertex is not finite.
    """
    parts = tuple(part for part in found if isinstance(part, Part) and len(part.triangles))
    wires = tuple(wire for wire in found if isinstance(wire, Wire) and len(wire.vertices))
    shapes: list[Part | Wire] = [*parts, *wires]
    for shape in shapes:
        if not np.isfinite(shape.vertices).all():
            raise ShapeError(path, f"{shape.name!r} has a vertex with a non-finite coordinate")
    warnings = declared.warnings
    textures = sorted({part.material.texture for part in parts} - {""})
    if textures:
        warnings = (*warnings, f"textures are kept by name, not drawn: {', '.join(textures[:10])}")
    if not parts and not wires:
        warnings = (*warnings, "has no shape that can be drawn")
    return Geometry(
        parts,
        wires,
        warnings=warnings,
        missing=declared.missing,
        files=declared.files,
        unit_m=declared.unit_m,
        up=declared.up,
    )


def _drawn(path: Path, kind: str, declared: Declared) -> list[Part | Wire]:
    """Return the shapes that trimesh reads from a file.

    Raises:
        ShapeError: For any exception of trimesh.
    """
    trimesh: Any = importlib.import_module("trimesh")
    # trimesh logs tracebacks; the cause is raised here instead.
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    try:
        with np.errstate(all="ignore"), warnings_module.catch_warnings():
            warnings_module.simplefilter("ignore")  # about intermediate values that are not kept
            scene = trimesh.load_scene(
                str(path) if declared.rewritten is None else io.BytesIO(declared.rewritten),
                file_type=kind,
                resolver=trimesh.resolvers.FilePathResolver(str(path)) if declared.rewritten else None,
                process=False,
                maintain_order=True,
                skip_materials=bool(declared.missing),
            )
            return list(_parts(scene, declared))
    except ShapeError:
        raise
    except MemoryError as error:
        raise ShapeError(path, "needs more memory than is available") from error
    # trimesh's readers raise arbitrary exceptions for damaged files.
    except Exception as error:
        raise ShapeError(path, f"cannot be read as {kind.upper()}: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    first = next(iter(str(error).splitlines()), "")[:200]
    return f"{first} ({type(error).__name__})" if first else type(error).__name__


def _parts(scene: Any, declared: Declared) -> Iterator[Part | Wire]:
    for node in scene.graph.nodes_geometry:
        placement, key = scene.graph[node]
        shape = scene.geometry[key]
        matrix = np.asarray(placement, dtype=np.float64)
        if hasattr(shape, "faces"):
            yield transformed(_part(str(key), shape, declared), matrix)
        else:
            yield placed(_points(str(key), shape), matrix)


def _part(name: str, shape: Any, declared: Declared) -> Part:
    vertices = np.array(shape.vertices, dtype=np.float64).reshape(-1, 3)
    triangles = np.array(shape.faces, dtype=np.int64).reshape(-1, 3)
    if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(vertices):
        raise ValueError(f"a triangle uses vertex {triangles.max()}; there are {len(vertices)}")
    # The cache holds the file's normals. The public property would compute smooth normals if there are none.
    given = np.asarray(shape._cache.cache.get("vertex_normals", np.zeros((0, 3))))
    visual = shape.visual
    material, two_sided = _material(visual, declared)
    colors = None
    if visual.kind == "face":
        colors = _rgba(visual.face_colors)[np.repeat(np.arange(len(triangles)), 3)]
    elif visual.kind == "vertex":
        colors = _rgba(visual.vertex_colors)
    elif visual.kind == "texture" and "color" in getattr(visual, "vertex_attributes", {}):
        colors = _rgba(visual.vertex_attributes["color"])
    return part_of(Part(name, material, vertices, given, triangles, two_sided, colors))


def part_of(part: Part) -> Part:
    """Return a part with normals, if it lacks some, and with a single colour as its material's."""
    vertices, triangles, colors = part.vertices, part.triangles, part.colors
    whole = part.normals.shape == vertices.shape and np.isfinite(part.normals).all()
    given = part.normals if whole else None
    if given is None and colors is None:
        vertices, given, triangles = creased(*welded(vertices, triangles), _CREASE)
    elif given is None or (colors is not None and len(colors) != len(vertices)):
        vertices, given, triangles, colors = _unrolled(vertices, given, triangles, colors)
    material = part.material
    if colors is not None and _uniform(colors):
        red, green, blue, opacity = colors[0].tolist()
        material = replace(material, diffuse=(red, green, blue), transparency=1 - opacity)
        colors = None
    return replace(
        part, material=material, vertices=vertices, normals=given, triangles=triangles, colors=colors
    )


def _unrolled(
    vertices: FloatArray, normals: FloatArray | None, triangles: IndexArray, colors: FloatArray | None
) -> tuple[FloatArray, FloatArray, IndexArray, FloatArray | None]:
    """Make each corner a separate vertex, for colours of faces, or for creases between coloured vertices."""
    flat = triangles.ravel()
    if normals is None:
        placed, smooth, faces = creased(*welded(vertices, triangles), _CREASE)
        corners, at_corners = placed[faces.ravel()], smooth[faces.ravel()]
    else:
        corners, at_corners = vertices[flat], normals[flat]
    if colors is not None and len(colors) == len(vertices) and len(vertices) != len(flat):
        colors = colors[flat]
    return corners, at_corners, np.arange(len(flat), dtype=np.int64).reshape(-1, 3), colors


def _uniform(colors: FloatArray) -> bool:
    return len(colors) > 0 and bool((colors == colors[0]).all())


def _rgba(values: Any) -> FloatArray:
    """Return (n, 4) sRGB colours with opacity, 0 to 1."""
    values = np.asarray(values)
    scale = np.iinfo(values.dtype).max if values.dtype.kind in "ui" else 1.0
    colors = np.ones((len(values), 4))
    colors[:, : values.shape[1]] = np.clip(values.astype(np.float64)[:, :4] / scale, 0, 1)
    return colors


def _material(visual: Any, declared: Declared) -> tuple[Material, bool]:
    found = getattr(visual, "material", None)
    if visual.kind != "texture" or found is None:
        return Material(), False
    name = str(getattr(found, "name", "") or "")
    texture = declared.textures.get(name, "")
    if hasattr(found, "baseColorFactor"):
        return _physical(found, name, texture), bool(getattr(found, "doubleSided", False))
    written = getattr(found, "kwargs", None) or {}
    diffuse = tuple(written["kd"]) if "kd" in written else np.asarray(found.diffuse)[:3] / 255
    specular = tuple(written["ks"]) if "ks" in written else (0.0, 0.0, 0.0)
    return (
        Material(
            name=name,
            diffuse=_color(diffuse),
            specular=_color(specular),
            emissive=_color(written.get("ke", (0.0, 0.0, 0.0))),
            # Phong's exponent, 0 to 1000, in VRML's scale (128 is 1).
            shininess=float(np.clip(float(written.get("ns", 25.6)) / 128, 0, 1)),
            transparency=_clipped(
                _first(written["tr"]) if "tr" in written else 1 - _first(written.get("d", 1))
            ),
            texture=texture,
        ),
        False,
    )


def _physical(found: Any, name: str, texture: str) -> Material:
    base = found.baseColorFactor
    rgba = _rgba([(1.0, 1.0, 1.0, 1.0) if base is None else base])[0]
    # Textures are not drawn, so a textured material without a base colour gets the default grey.
    diffuse = (0.8, 0.8, 0.8) if texture and base is None else rgba[:3]
    glow = found.emissiveFactor
    return Material(
        name=name,
        diffuse=_color(diffuse),
        emissive=_color((0.0, 0.0, 0.0) if glow is None else np.asarray(glow, dtype=np.float64)[:3]),
        transparency=_clipped(1 - float(rgba[3])),
        texture=texture,
    )


def _first(value: Any) -> float:
    return float(value[0] if isinstance(value, (list, tuple)) else value)


def _clipped(value: float) -> float:
    return float(np.clip(value, 0.0, 1.0)) if np.isfinite(value) else 0.0


def _color(values: Any) -> Color:
    red, green, blue = (_clipped(float(value)) for value in tuple(values)[:3])
    return red, green, blue


def _points(name: str, shape: Any) -> Wire:
    vertices = np.array(shape.vertices, dtype=np.float64).reshape(-1, 3)
    given = np.asarray(shape.colors) if getattr(shape, "colors", None) is not None else np.zeros((0, 4))
    colors = _rgba(given) if len(given) == len(vertices) > 0 else None
    return Wire(name, Material(), vertices, np.zeros((0, 2), dtype=np.int64), colors)
