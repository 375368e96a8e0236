"""`robomesh mesh`: what is in a mesh file, and the same in another format."""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from robomesh.atomic_write import write_atomically
from robots.meshes.mesh import Mesh, transformed_mesh
from robots.meshes.read import Progress, read_mesh
from robots.meshes.three_ds.write import write_3ds
from robots.meshes.unit_guess import file_to_link, guess
from robots.meshes.vrml.write import write_vrml
from robots.meshes.write_glb import glb_of
from robots.meshes.write_others import write_obj, write_ply, write_stl
from robots.summary import mesh_summary
from services.command_line.discovery import print_json
from services.errors import ServiceError

# Smaller files are read before a person looks.
_LARGE_BYTES = 2_000_000
_MOST_COLORS = 20


class ConversionError(ServiceError):
    """A mesh that cannot be converted as asked."""


def info(file: Path, as_json: bool) -> None:
    """Print what a mesh file holds."""
    mesh = read_mesh(file, _progress(file), within=file.absolute().parent)
    summary = mesh_summary(mesh)
    if as_json:
        print_json(summary)
        return
    print(f"{file.name}: {summary['triangles']} triangles")
    print(f"  from {_triple(summary['min'])} to {_triple(summary['max'])}, in the file's own units")
    print(f"  {guess(mesh).sentence}")
    print(f"  materials: {', '.join(filter(None, summary['materials'])) or 'none named'}")
    listed = summary["colors"][:_MOST_COLORS]
    more = len(summary["colors"]) - len(listed)
    print(f"  colors: {', '.join(listed) or 'none'}{f' and {more} more' if more else ''}")
    for warning in summary["warnings"]:
        print(f"  warning: {warning}")


def convert(source: Path, target: Path, scale: float | None, up: str | None) -> None:
    """Write a mesh file's content in the format that the target's ending names."""
    ending = target.suffix.lower()
    if ending not in _WRITERS:
        raise ConversionError(f"{target}: ending {ending!r} is not written; {', '.join(_WRITERS)} are")
    if up not in (None, "y", "z"):
        raise ConversionError(f"--up {up}: y or z is right")
    if scale is not None and not (np.isfinite(scale) and scale > 0):
        raise ConversionError(f"--scale {scale}: a number above 0 is right")
    if target.exists() and source.exists() and target.samefile(source):
        raise ConversionError(f"{target}: is the file that is to be converted; name another")
    mesh = read_mesh(source, _progress(source), within=source.absolute().parent)
    for warning in mesh.warnings:
        _say(f"{source.name}: {warning}")
    if not mesh.parts and not mesh.wires:
        raise ConversionError(f"{source}: holds nothing that can be drawn; nothing is written")
    placed = transformed_mesh(mesh, _placement(mesh, ending, scale, up))
    for loss in _losses(placed, ending):
        _say(f"{target.name}: {loss}")
    try:
        files = _WRITERS[ending](placed, target)
    except ValueError as error:
        raise ConversionError(f"{target}: {error}") from None
    for path, content in files.items():
        _write(path, content)
    print(f"{target}: {placed.triangle_count} triangles")


def _placement(mesh: Mesh, ending: str, scale: float | None, up: str | None) -> Any:
    """GLB is in metres and z up, by what the file says or is guessed; others stay as they are unless told."""
    found = guess(mesh)
    if ending != ".glb":
        factor, axis = scale or 1.0, up or "z"
    else:
        factor, axis = scale or found.scale_m, up or found.up
        if scale is None or up is None:
            _say(found.sentence)
    return file_to_link(type(found)(factor, axis, ""))


def _losses(mesh: Mesh, ending: str) -> list[str]:
    losses = []
    if ending == ".stl":
        losses.append("STL holds shape alone: colours, transparency and names are lost")
    if ending == ".ply":
        losses.append("PLY holds colours by vertex: names, shine and textures of materials are lost")
    if ending in (".wrl", ".3ds", ".obj") and any(part.colors is not None for part in mesh.parts):
        losses.append("colours of vertices are lost")
    if ending != ".glb" and mesh.wires:
        losses.append("lines and points are lost")
    return losses


def _glb(mesh: Mesh, target: Path) -> dict[Path, bytes]:
    return {target: glb_of(mesh)}


def _obj(mesh: Mesh, target: Path) -> dict[Path, bytes]:
    library = target.with_suffix(".mtl")
    text, materials = write_obj(mesh, library.name)
    # The materials first: an .obj that is there has them beside it.
    return {library: materials.encode(), target: text.encode()}


def _vrml(mesh: Mesh, target: Path) -> dict[Path, bytes]:
    return {target: write_vrml(mesh, decimals=9).encode()}


_WRITERS: Mapping[str, Callable[[Mesh, Path], dict[Path, bytes]]] = {
    ".glb": _glb,
    ".stl": lambda mesh, target: {target: write_stl(mesh)},
    ".obj": _obj,
    ".ply": lambda mesh, target: {target: write_ply(mesh)},
    ".wrl": _vrml,
    ".3ds": lambda mesh, target: {target: write_3ds(mesh)},
}


def _write(path: Path, content: bytes) -> None:
    try:
        write_atomically(path, content, mode=0o666, fsync=False)
    except OSError as error:
        raise ConversionError(f"{path}: cannot be written: {error.strerror}") from None


def _progress(file: Path) -> Progress | None:
    """Percent on standard error, where a person sees it and a file is large."""
    if not sys.stderr.isatty() or not file.is_file() or file.stat().st_size < _LARGE_BYTES:
        return None

    def show(done: float) -> None:
        sys.stderr.write(f"\rreading {file.name}: {done:4.0%}" if done < 1 else "\r\x1b[K")
        sys.stderr.flush()

    return show


def _say(text: str) -> None:
    print(f"robomesh: {text}", file=sys.stderr)


def _triple(values: Any) -> str:
    return "({:.6g}, {:.6g}, {:.6g})".format(*values)
