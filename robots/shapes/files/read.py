"""Choice of a shape file's reader by its content, or by its ending where the content is ambiguous."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from robots.schema.errors import ShapeError
from robots.shapes.files.dxf import read_dxf
from robots.shapes.files.gltf import read_gltf
from robots.shapes.files.step import read_step
from robots.shapes.files.text_repair import plain_text
from robots.shapes.files.three_ds.read import read_3ds
from robots.shapes.files.trimesh_formats import read_trimesh
from robots.shapes.files.vrml.read import read_vrml
from robots.shapes.geometry import Geometry

Progress = Callable[[float], None]

READERS: Mapping[str, Callable[..., Geometry]] = {
    ".wrl": read_vrml,
    ".vrml": read_vrml,
    ".wrz": read_vrml,
    ".3ds": read_3ds,
    ".dxf": read_dxf,
    ".stl": read_trimesh,
    ".obj": read_trimesh,
    ".ply": read_trimesh,
    ".dae": read_trimesh,
    ".glb": read_gltf,
    ".gltf": read_gltf,
    ".step": read_step,
    ".stp": read_step,
    ".iges": read_step,
    ".igs": read_step,
}
# Formats with a signature; OBJ, and VRML without its header, have none.
_BEGINNINGS = (
    (b"#VRML", ".wrl"),
    (b"glTF", ".glb"),
    (b"ply\n", ".ply"),
    (b"ply\r", ".ply"),
    (b"ISO-10303-21", ".step"),
    (b"AutoCAD Binary DXF", ".dxf"),
)


def read_geometry(path: Path, progress: Progress | None = None, *, within: Path | None = None) -> Geometry:
    """Return a shape file's content, in the file's units and axes.

    Args:
        progress: Called with the completed fraction, 0 to 1, by readers that know it.
        within: Other files are read below this folder only; files elsewhere count as missing.

    Raises:
        ShapeError: If the format is not supported, or the file is invalid.
    """
    ending = path.suffix.lower()
    kind = _kind_of_content(path) or ending
    reader = READERS.get(kind)
    if reader is None:
        raise ShapeError(path, f"ending {path.suffix!r} is not supported; use {', '.join(READERS)}")
    options: dict[str, Any] = {"progress": progress, "within": within, "kind": kind.lstrip(".")}
    taken = inspect.signature(reader).parameters
    geometry = reader(path, **{name: value for name, value in options.items() if name in taken})
    if READERS.get(ending) is reader and (kind == ending or reader not in (read_trimesh, read_gltf)):
        return geometry
    return replace(
        geometry,
        warnings=(f"ends in {ending!r} but contains {kind[1:].upper()}; read as that", *geometry.warnings),
    )


def _kind_of_content(path: Path) -> str:
    """Return the ending that fits a file's first bytes; empty if they are ambiguous."""
    try:
        with path.open("rb") as file:
            head = file.read(1024)
    except OSError as error:
        raise ShapeError(path, f"cannot be read: {error.strerror}") from error
    for beginning, ending in _BEGINNINGS:
        if head.startswith(beginning):
            return ending
    head = (head[:2] in (b"\xff\xfe", b"\xfe\xff") and plain_text(head).encode()) or head
    text = head.lstrip()
    if head[:2] == b"MM" and len(head) >= 6:
        return ".3ds" if path.suffix.lower() not in (".wrl", ".obj") or b"\0" in head else ""
    if text.startswith((b"<?xml", b"<COLLADA")) and b"<COLLADA" in head:
        return ".dae"
    if text.startswith(b"solid") and b"facet" in head:
        return ".stl"
    if text[:1] == b"0" and b"SECTION" in head[:40]:
        return ".dxf"
    if head[72:73] == b"S" and head[73:80].lstrip(b" 0") == b"1":
        return ".iges"
    return ""
