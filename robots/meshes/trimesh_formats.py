"""STL, OBJ, PLY, DAE, GLB and glTF to meshes, read by trimesh.

Every triangle of the file is kept, as it stands, placed by the file's own nodes; axes and units
stay the file's. Normals that a file does not give are smooth up to 30 degrees.
"""

import importlib
import io
import logging
import warnings as warnings_module
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from robots.errors import MeshError
from robots.meshes.declared_size import Claims, claims_of
from robots.meshes.mesh import (
    Color,
    FloatArray,
    IndexArray,
    Material,
    Mesh,
    Part,
    Wire,
    placed,
    transformed,
    welded,
)
from robots.meshes.normals import creased

_CREASE = np.radians(30)


def read_trimesh(path: Path, *, kind: str = "") -> Mesh:
    """The content of an STL, OBJ, PLY, DAE, GLB or glTF file, in its own units and axes.

    Files that it names are read below its own folder only; others count as missing.

    Args:
        kind: The ending that says what it is ("stl"); the file's own unless given.

    Raises:
        MeshError: If it is not what its ending says, or holds what cannot be drawn.
    """
    kind = kind or path.suffix.lower().lstrip(".")
    claims = claims_of(path, kind)
    found = _drawn(path, kind, claims)
    parts = tuple(part for part in found if isinstance(part, Part) and len(part.triangles))
    wires = tuple(wire for wire in found if isinstance(wire, Wire) and len(wire.vertices))
    _check(path, kind, parts, wires)
    warnings = claims.warnings
    textures = sorted({part.material.texture for part in parts} - {""})
    if textures:
        warnings = (*warnings, f"textures are kept by name, not drawn: {', '.join(textures[:10])}")
    if not parts and not wires:
        warnings = (*warnings, "holds nothing that can be drawn")
    return Mesh(
        parts,
        wires,
        warnings=warnings,
        missing=claims.missing,
        files=claims.files,
        unit_m=claims.unit_m,
        up=claims.up,
    )


def _drawn(path: Path, kind: str, claims: Claims) -> list[Part | Wire]:
    """What trimesh finds in a file; its errors, whatever they are, as ours."""
    trimesh: Any = importlib.import_module("trimesh")
    # What it logs are tracebacks; what matters of them is raised here.
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    try:
        with np.errstate(all="ignore"), warnings_module.catch_warnings():
            warnings_module.simplefilter("ignore")  # its own arithmetic's, on nothing that is kept
            scene = trimesh.load_scene(
                str(path) if claims.rewritten is None else io.BytesIO(claims.rewritten),
                file_type=kind,
                resolver=trimesh.resolvers.FilePathResolver(str(path)) if claims.rewritten else None,
                process=False,
                maintain_order=True,
                skip_materials=bool(claims.missing),
            )
            return list(_parts(scene, claims))
    except MeshError:
        raise
    except MemoryError as error:
        raise MeshError(path, "needs more memory than there is") from error
    # Its readers raise whatever their code runs into.
    except Exception as error:
        raise MeshError(path, f"is no {kind.upper()} that can be read: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    first = next(iter(str(error).splitlines()), "")[:200]
    return f"{first} ({type(error).__name__})" if first else type(error).__name__


def _check(path: Path, kind: str, parts: tuple[Part, ...], wires: tuple[Wire, ...]) -> None:
    shapes: list[Part | Wire] = [*parts, *wires]
    for shape in shapes:
        if not np.isfinite(shape.vertices).all():
            raise MeshError(path, f"{shape.name!r} has a vertex that is not finite; numbers are right")
    if not parts and not wires and kind == "stl":
        raise MeshError(path, "is no STL: it holds no facet")


def _parts(scene: Any, claims: Claims) -> Iterator[Part | Wire]:
    for node in scene.graph.nodes_geometry:
        placement, key = scene.graph[node]
        shape = scene.geometry[key]
        matrix = np.asarray(placement, dtype=np.float64)
        if hasattr(shape, "faces"):
            yield transformed(_part(str(key), shape, claims), matrix)
        else:
            yield placed(_wire(str(key), shape, claims), matrix)


def _part(name: str, shape: Any, claims: Claims) -> Part:
    vertices = np.array(shape.vertices, dtype=np.float64).reshape(-1, 3)
    triangles = np.array(shape.faces, dtype=np.int64).reshape(-1, 3)
    if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(vertices):
        raise ValueError(f"a triangle names vertex {triangles.max()}; there are {len(vertices)}")
    # Normals of the file are in its cache before anything is asked; else trimesh would make smooth ones.
    given = shape._cache.cache.get("vertex_normals")
    if given is not None:
        given = np.asarray(given)
        given = given if given.shape == vertices.shape and np.isfinite(given).all() else None
    visual = shape.visual
    material, two_sided = _material(visual, claims)
    colors = None
    if visual.kind == "face":
        colors = _rgba(visual.face_colors, claims)[np.repeat(np.arange(len(triangles)), 3)]
    elif visual.kind == "vertex":
        colors = _rgba(visual.vertex_colors, claims)
    elif visual.kind == "texture" and "color" in getattr(visual, "vertex_attributes", {}):
        colors = _rgba(visual.vertex_attributes["color"], claims)
    if given is None and colors is None:
        vertices, given, triangles = creased(*welded(vertices, triangles), _CREASE)
    elif given is None or (colors is not None and len(colors) != len(vertices)):
        vertices, given, triangles, colors = _unrolled(vertices, given, triangles, colors)
    if colors is not None and _uniform(colors):
        red, green, blue, opacity = colors[0].tolist()
        material = replace(material, diffuse=(red, green, blue), transparency=1 - opacity)
        colors = None
    return Part(name, material, vertices, given, triangles, two_sided=two_sided, colors=colors)


def _unrolled(
    vertices: FloatArray, normals: FloatArray | None, triangles: IndexArray, colors: FloatArray | None
) -> tuple[FloatArray, FloatArray, IndexArray, FloatArray | None]:
    """Each corner a vertex of its own: colours of faces, and creases beside colours of vertices."""
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


def _rgba(values: Any, claims: Claims) -> FloatArray:
    """(n, 4), 0 to 1, sRGB."""
    values = np.asarray(values)
    scale = np.iinfo(values.dtype).max if values.dtype.kind in "ui" else 1.0
    colors = np.ones((len(values), 4))
    colors[:, : values.shape[1]] = np.clip(values.astype(np.float64)[:, :4] / scale, 0, 1)
    if claims.linear:
        colors[:, :3] = srgb_of_linear(colors[:, :3])
    return colors


def srgb_of_linear(values: FloatArray) -> FloatArray:
    """Linear light, 0 to 1, as sRGB."""
    low = values <= 0.0031308
    result: FloatArray = np.where(low, 12.92 * values, 1.055 * np.maximum(values, 0) ** (1 / 2.4) - 0.055)
    return result


def _material(visual: Any, claims: Claims) -> tuple[Material, bool]:
    found = getattr(visual, "material", None)
    if visual.kind != "texture" or found is None:
        return Material(), False
    name = str(getattr(found, "name", "") or "")
    texture = claims.textures.get(name, "")
    if hasattr(found, "baseColorFactor"):
        return _physical(found, name, texture, claims), bool(getattr(found, "doubleSided", False))
    written = getattr(found, "kwargs", None) or {}
    diffuse = tuple(written["kd"]) if "kd" in written else np.asarray(found.diffuse)[:3] / 255
    specular = tuple(written["ks"]) if "ks" in written else (0.0, 0.0, 0.0)
    return (
        Material(
            name=name,
            diffuse=_color(diffuse),
            specular=_color(specular),
            emissive=_color(written.get("ke", (0.0, 0.0, 0.0))),
            # Phong's exponent, 0 to 1000, as VRML counts it (128 is 1).
            shininess=float(np.clip(float(written.get("ns", 25.6)) / 128, 0, 1)),
            transparency=_clipped(
                _first(written["tr"]) if "tr" in written else 1 - _first(written.get("d", 1))
            ),
            texture=texture,
        ),
        False,
    )


def _physical(found: Any, name: str, texture: str, claims: Claims) -> Material:
    base = claims.base_colors.get(name, found.baseColorFactor)
    rgba = _rgba(np.asarray([base if base is not None else (1.0, 1.0, 1.0, 1.0)]), claims)[0]
    # Without its picture a white texture's base says nothing: grey, as materials are without colour.
    diffuse = (0.8, 0.8, 0.8) if texture and base is None else rgba[:3]
    glow = found.emissiveFactor
    emissive = (0.0, 0.0, 0.0) if glow is None else np.asarray(glow, dtype=np.float64)[:3]
    if claims.linear:
        emissive = srgb_of_linear(np.clip(np.asarray(emissive), 0, 1))
    blended = not claims.linear or str(found.alphaMode or "OPAQUE") == "BLEND"
    return Material(
        name=name,
        diffuse=_color(diffuse),
        emissive=_color(emissive),
        transparency=_clipped(1 - float(rgba[3])) if blended else 0.0,
        texture=texture,
    )


def _first(value: Any) -> float:
    return float(value[0] if isinstance(value, (list, tuple)) else value)


def _clipped(value: float) -> float:
    return float(np.clip(value, 0.0, 1.0)) if np.isfinite(value) else 0.0


def _color(values: Any) -> Color:
    red, green, blue = (_clipped(float(value)) for value in tuple(values)[:3])
    return red, green, blue


def _wire(name: str, shape: Any, claims: Claims) -> Wire:
    """Lines of a path, or points."""
    vertices = np.array(shape.vertices, dtype=np.float64).reshape(-1, 3)
    if not hasattr(shape, "entities"):
        given = np.asarray(shape.colors) if getattr(shape, "colors", None) is not None else np.zeros((0, 4))
        colors = _rgba(given, claims) if len(given) == len(vertices) > 0 else None
        return Wire(name, Material(), vertices, np.zeros((0, 2), dtype=np.int64), colors)
    runs = [np.asarray(entity.points, dtype=np.int64) for entity in shape.entities]
    pairs = [np.column_stack([run[:-1], run[1:]]) for run in runs]
    return Wire(name, Material(), vertices, np.concatenate([np.zeros((0, 2), dtype=np.int64), *pairs]))
