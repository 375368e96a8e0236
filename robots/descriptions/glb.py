"""A robot's links as GLB, for the network and for URDF.

Each link's shape is in the link's frame [m], turned to glTF's y up, in the description's colours. Finished
files are in the user's cache, keyed by the content that they were made from.
"""

import hashlib
import json
import logging
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from robomesh.files.atomic_write import write_atomically
from robots.kinematics.kinematic_tree import Shape, tree_of
from robots.schema.errors import ShapeError
from robots.schema.robot_toml import RobotDescription
from robots.shapes.files.gltf import glb_chunks
from robots.shapes.files.read import read_geometry
from robots.shapes.files.write_glb import glb_of
from robots.shapes.geometry import PAINT, Y_UP_TO_Z_UP, Color, Geometry, Part, Wire, transformed_geometry
from robots.shapes.simplify import lightened

__all__ = [
    "MOST_TRIANGLES",
    "cache_folder",
    "collision_glbs",
    "glb_of",
    "link_geometry",
    "link_glbs",
    "main_colors",
    "shapes_glb",
]

logger = logging.getLogger(__name__)

# Part of each cache key. Increment it when the same shape file should give another GLB.
_VERSION = 7
# Links are sent to phones too, and no screen shows more.
MOST_TRIANGLES = 200_000


def link_glbs(description: RobotDescription, *, cache: Path | None = None) -> dict[str, bytes]:
    """Return the GLB of each link that has a shape, by link name, base first; in the link's frame [m].

    Args:
        cache: Folder of finished GLB files; by default the user's cache folder.

    Raises:
        ShapeError: If a shape file cannot be read.
    """
    folder = cache_folder() if cache is None else cache
    links = tree_of(description).links
    return {link.name: shapes_glb(link.shapes, cache=folder) for link in links if link.shapes}


def collision_glbs(description: RobotDescription, *, cache: Path | None = None) -> dict[str, bytes]:
    """Return the GLB of each link's separate collision shapes, if it has any; see `link_glbs`.

    Raises:
        ShapeError: If a shape file cannot be read.
    """
    folder = cache_folder() if cache is None else cache
    links = tree_of(description).links
    return {link.name: shapes_glb(link.collision, cache=folder) for link in links if link.collision}


def shapes_glb(shapes: tuple[Shape, ...], *, cache: Path | None = None) -> bytes:
    """Return the GLB of the shapes of a link or another object, in its frame [m].

    Raises:
        ShapeError: If a shape file cannot be read.
    """
    return _cached_glb(shapes, cache_folder() if cache is None else cache)


def main_colors(glbs: Mapping[str, bytes]) -> dict[str, Color]:
    """Return the main colour of each GLB that robomesh wrote."""
    found = {name: _main_color_of(glb) for name, glb in glbs.items()}
    return {name: color for name, color in found.items() if color is not None}


def _main_color_of(glb: bytes) -> Color | None:
    """Return the main colour of a GLB; None: it has none, or another program wrote it."""
    try:
        document, _ = glb_chunks(glb, "the GLB")
        red, green, blue = map(float, document["asset"]["extras"]["robomesh"]["main_color"])
    except (ShapeError, ValueError, KeyError, TypeError):
        return None
    return red, green, blue


def cache_folder() -> Path:
    """Return the cache folder, below XDG_CACHE_HOME or ~/.cache; a temporary folder if that is read-only."""
    home = os.environ.get("XDG_CACHE_HOME")
    roots = [Path(home)] if home else [Path.home() / ".cache"]
    for root in [*roots, Path(tempfile.gettempdir())]:
        folder = root / "robomesh" / "meshes"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        # In the temporary folder, another user may own a folder of this name and could change its files.
        if os.access(folder, os.W_OK) and folder.stat().st_uid == os.getuid():
            return folder
    return Path(tempfile.mkdtemp(prefix="robomesh-meshes-"))


def _cached_glb(shapes: tuple[Shape, ...], folder: Path) -> bytes:
    files = [_remembered_files(shape, folder) for shape in shapes]
    cached = folder / f"{_key(shapes, files)}.glb"
    if cached.is_file():
        return cached.read_bytes()
    geometries = [_placed(shape) for shape in shapes]
    geometry = _joined(geometries)
    light = lightened(geometry, MOST_TRIANGLES)
    if light is not geometry:
        source = next((shape.source.name for shape in shapes if isinstance(shape.source, Path)), "a link")
        logger.info("%s: %d triangles sent as %d", source, geometry.triangle_count, light.triangle_count)
    glb = glb_of(light)
    now = [geometry.files for geometry in geometries]
    for shape, before, found in zip(shapes, files, now, strict=True):
        if isinstance(shape.source, Path) and tuple(before) != found:
            home = shape.source.resolve().parent
            named = [os.path.relpath(file, home) for file in found]
            _store(_references_file(shape, folder), json.dumps(named).encode())
    _store(folder / f"{_key(shapes, now)}.glb", glb)
    return glb


def _remembered_files(shape: Shape, folder: Path) -> tuple[Path, ...]:
    """Return the files that a shape's file, with this content, referred to when it was last read."""
    if not isinstance(shape.source, Path):
        return ()
    try:
        home = shape.source.resolve().parent
        named = json.loads(_references_file(shape, folder).read_bytes())
        return tuple(Path(os.path.normpath(home / file)) for file in named)
    except (OSError, ValueError):
        return ()


def _references_file(shape: Shape, folder: Path) -> Path:
    return folder / f"{_key([shape], [()])}.files"


def _key(shapes: Sequence[Shape], files: Sequence[Sequence[Path]]) -> str:
    """Return a cache key for the GLB of shapes: a hash of everything that it depends on.

    Args:
        files: For each shape, the files that its shape file refers to, whether they exist or not.
    """
    digest = hashlib.sha256(str(_VERSION).encode())
    for shape, others in zip(shapes, files, strict=True):
        options = f"{shape.shape_to_link.tolist()!r} {shape.color} {shape.opacity} {shape.in_stated_unit} "
        # The folder limit decides which of the other files are read.
        if shape.within is not None and isinstance(shape.source, Path):
            options += os.path.relpath(shape.within.resolve(), shape.source.resolve().parent)
        digest.update(options.encode())
        for part in _content(shape.source, others):
            digest.update(hashlib.sha256(part).digest())
    return digest.hexdigest()


def _content(source: Path | Geometry, others: Sequence[Path]) -> Iterator[bytes]:
    if isinstance(source, Path):
        yield source.suffix.lower().encode()
        for path in (source, *others):
            yield b"there" if path.is_file() else b"missing"
            yield path.read_bytes() if path.is_file() else b""
        yield repr([os.path.relpath(path, source.resolve().parent) for path in others]).encode()
        return
    pieces: list[Part | Wire] = [*source.parts, *source.wires]
    for piece in pieces:
        for field in fields(piece):
            value = getattr(piece, field.name)
            yield value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode()


def link_geometry(shapes: Sequence[Shape]) -> Geometry:
    """Join a link's shapes to one geometry in its frame [m], in the description's colours.

    Raises:
        ShapeError: If a shape file cannot be read.
    """
    return _joined([_placed(shape) for shape in shapes])


def _joined(geometries: Sequence[Geometry]) -> Geometry:
    return Geometry(
        parts=tuple(part for geometry in geometries for part in geometry.parts),
        wires=tuple(wire for geometry in geometries for wire in geometry.wires),
        warnings=tuple(warning for geometry in geometries for warning in geometry.warnings),
        files=tuple(file for geometry in geometries for file in geometry.files),
    )


def _placed(shape: Shape) -> Geometry:
    geometry = (
        read_geometry(shape.source, within=shape.within) if isinstance(shape.source, Path) else shape.source
    )
    placement = shape.shape_to_link
    if shape.in_stated_unit and geometry.unit_m is not None:
        placement = placement @ np.diag([geometry.unit_m, geometry.unit_m, geometry.unit_m, 1.0])
        # As in ROS, from RViz of 2025 on: glTF is turned, COLLADA is not.
        if (
            geometry.up == "y"
            and isinstance(shape.source, Path)
            and shape.source.suffix.lower() in (".glb", ".gltf")
        ):
            placement = placement @ Y_UP_TO_Z_UP
    geometry = transformed_geometry(geometry, placement)
    names = {part.material.name for part in geometry.parts}
    return replace(
        geometry,
        parts=tuple(
            _painted(part, shape) if PAINT not in names or part.material.name == PAINT else part
            for part in geometry.parts
        ),
    )


def _painted(part: Part, shape: Shape) -> Part:
    material = part.material
    if shape.color is not None:
        material = replace(material, diffuse=shape.color)
        part = replace(part, colors=None)
    if shape.opacity is not None:
        material = replace(material, transparency=1.0 - shape.opacity)
    return replace(part, material=material)


def _store(path: Path, content: bytes) -> None:
    """Write a cache file atomically, because another process may read it at any time."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, content, fsync=False)
    except OSError as error:
        logger.warning("mesh cache %s: %s; each start converts the meshes again", path.parent, error.strerror)
