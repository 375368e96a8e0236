"""A robot's links as GLB, for the network and for URDF.

Each link's mesh is in the link's frame [m], turned to glTF's y up, in the description's colours. Finished
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
from robots.schema.errors import MeshError
from robots.schema.robot_toml import RobotDescription
from robots.shapes.files.gltf import glb_chunks
from robots.shapes.files.read import read_mesh
from robots.shapes.files.write_glb import glb_of
from robots.shapes.mesh import PAINT, Y_UP_TO_Z_UP, Color, Mesh, Part, Wire, transformed_mesh
from robots.shapes.simplify import lightened

__all__ = [
    "MOST_TRIANGLES",
    "cache_folder",
    "collision_meshes",
    "glb_of",
    "link_mesh",
    "link_meshes",
    "main_colors",
    "shapes_glb",
]

logger = logging.getLogger(__name__)

# Part of each cache key. Increment it when the same mesh file should give another GLB.
_VERSION = 7
# Links are sent to phones too, and no screen shows more.
MOST_TRIANGLES = 200_000


def link_meshes(description: RobotDescription, *, cache: Path | None = None) -> dict[str, bytes]:
    """Return the GLB of each link that has a shape, by link name, base first; in the link's frame [m].

    Args:
        cache: Folder of finished GLB files; by default the user's cache folder.

    Raises:
        MeshError: If a mesh file cannot be read.
    """
    folder = cache_folder() if cache is None else cache
    links = tree_of(description).links
    return {link.name: shapes_glb(link.shapes, cache=folder) for link in links if link.shapes}


def collision_meshes(description: RobotDescription, *, cache: Path | None = None) -> dict[str, bytes]:
    """Return the GLB of each link's separate collision shapes, if it has any; see `link_meshes`.

    Raises:
        MeshError: If a mesh file cannot be read.
    """
    folder = cache_folder() if cache is None else cache
    links = tree_of(description).links
    return {link.name: shapes_glb(link.collision, cache=folder) for link in links if link.collision}


def shapes_glb(shapes: tuple[Shape, ...], *, cache: Path | None = None) -> bytes:
    """Return the GLB of the shapes of a link or another object, in its frame [m].

    Raises:
        MeshError: If a mesh file cannot be read.
    """
    return _cached_glb(shapes, cache_folder() if cache is None else cache)


def main_colors(meshes: Mapping[str, bytes]) -> dict[str, Color]:
    """Return the main colour of each GLB that robomesh wrote."""
    found = {name: _main_color_of(glb) for name, glb in meshes.items()}
    return {name: color for name, color in found.items() if color is not None}


def _main_color_of(glb: bytes) -> Color | None:
    """Return the main colour of a GLB; None: it has none, or another program wrote it."""
    try:
        document, _ = glb_chunks(glb, "the GLB")
        red, green, blue = map(float, document["asset"]["extras"]["robomesh"]["main_color"])
    except (MeshError, ValueError, KeyError, TypeError):
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
    meshes = [_placed(shape) for shape in shapes]
    mesh = _joined(meshes)
    light = lightened(mesh, MOST_TRIANGLES)
    if light is not mesh:
        source = next((shape.mesh.name for shape in shapes if isinstance(shape.mesh, Path)), "a link")
        logger.info("%s: %d triangles sent as %d", source, mesh.triangle_count, light.triangle_count)
    glb = glb_of(light)
    now = [mesh.files for mesh in meshes]
    for shape, before, found in zip(shapes, files, now, strict=True):
        if isinstance(shape.mesh, Path) and tuple(before) != found:
            home = shape.mesh.resolve().parent
            named = [os.path.relpath(file, home) for file in found]
            _store(_references_file(shape, folder), json.dumps(named).encode())
    _store(folder / f"{_key(shapes, now)}.glb", glb)
    return glb


def _remembered_files(shape: Shape, folder: Path) -> tuple[Path, ...]:
    """Return the files that a shape's file, with this content, referred to when it was last read."""
    if not isinstance(shape.mesh, Path):
        return ()
    try:
        home = shape.mesh.resolve().parent
        named = json.loads(_references_file(shape, folder).read_bytes())
        return tuple(Path(os.path.normpath(home / file)) for file in named)
    except (OSError, ValueError):
        return ()


def _references_file(shape: Shape, folder: Path) -> Path:
    return folder / f"{_key([shape], [()])}.files"


def _key(shapes: Sequence[Shape], files: Sequence[Sequence[Path]]) -> str:
    """Return a cache key for the GLB of shapes: a hash of everything that it depends on.

    Args:
        files: For each shape, the files that its mesh file refers to, whether they exist or not.
    """
    digest = hashlib.sha256(str(_VERSION).encode())
    for shape, others in zip(shapes, files, strict=True):
        options = f"{shape.shape_to_link.tolist()!r} {shape.color} {shape.opacity} {shape.in_stated_unit} "
        # The folder limit decides which of the other files are read.
        if shape.within is not None and isinstance(shape.mesh, Path):
            options += os.path.relpath(shape.within.resolve(), shape.mesh.resolve().parent)
        digest.update(options.encode())
        for part in _content(shape.mesh, others):
            digest.update(hashlib.sha256(part).digest())
    return digest.hexdigest()


def _content(mesh: Path | Mesh, others: Sequence[Path]) -> Iterator[bytes]:
    if isinstance(mesh, Path):
        yield mesh.suffix.lower().encode()
        for path in (mesh, *others):
            yield b"there" if path.is_file() else b"missing"
            yield path.read_bytes() if path.is_file() else b""
        yield repr([os.path.relpath(path, mesh.resolve().parent) for path in others]).encode()
        return
    pieces: list[Part | Wire] = [*mesh.parts, *mesh.wires]
    for piece in pieces:
        for field in fields(piece):
            value = getattr(piece, field.name)
            yield value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode()


def link_mesh(shapes: Sequence[Shape]) -> Mesh:
    """Join a link's shapes to one mesh in its frame [m], in the description's colours.

    Raises:
        MeshError: If a mesh file cannot be read.
    """
    return _joined([_placed(shape) for shape in shapes])


def _joined(meshes: Sequence[Mesh]) -> Mesh:
    return Mesh(
        parts=tuple(part for mesh in meshes for part in mesh.parts),
        wires=tuple(wire for mesh in meshes for wire in mesh.wires),
        warnings=tuple(warning for mesh in meshes for warning in mesh.warnings),
        files=tuple(file for mesh in meshes for file in mesh.files),
    )


def _placed(shape: Shape) -> Mesh:
    mesh = read_mesh(shape.mesh, within=shape.within) if isinstance(shape.mesh, Path) else shape.mesh
    placement = shape.shape_to_link
    if shape.in_stated_unit and mesh.unit_m is not None:
        placement = placement @ np.diag([mesh.unit_m, mesh.unit_m, mesh.unit_m, 1.0])
        # As in ROS, from RViz of 2025 on: glTF is turned, COLLADA is not.
        if mesh.up == "y" and isinstance(shape.mesh, Path) and shape.mesh.suffix.lower() in (".glb", ".gltf"):
            placement = placement @ Y_UP_TO_Z_UP
    mesh = transformed_mesh(mesh, placement)
    names = {part.material.name for part in mesh.parts}
    return replace(
        mesh,
        parts=tuple(
            _painted(part, shape) if PAINT not in names or part.material.name == PAINT else part
            for part in mesh.parts
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
