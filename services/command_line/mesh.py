"""`robomesh mesh`: what a mesh file holds, and conversion to another format.

A command imports the readers and writers when it runs: with numpy they take half a second.
"""

import sys
from collections.abc import Callable
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from robomesh.atomic_write import write_atomically
from services.command_line.options import command_group
from services.errors import ServiceError

if TYPE_CHECKING:
    from robots.meshes.mesh import Mesh
    from robots.meshes.read import Progress

# A smaller file is read before a progress display would be useful.
_LARGE_BYTES = 2_000_000
_MOST_COLORS = 20

app = command_group("mesh", "Mesh files: inspect, convert.")


class ConversionError(ServiceError):
    """The mesh cannot be converted as requested."""


@app.command()
def info(
    file: Annotated[Path, typer.Argument(metavar="FILE")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, in the file's own units.")] = False,
) -> None:
    """Show triangles, bounds and materials of a mesh file, in its own units and axes."""
    from robots.meshes.read import read_mesh
    from robots.meshes.unit_guess import guess
    from robots.summary import mesh_summary
    from services.command_line.discovery import print_json

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


@app.command()
def convert(
    source: Annotated[Path, typer.Argument(metavar="IN")],
    target: Annotated[Path, typer.Argument(metavar="OUT", help=".glb, .stl, .obj, .ply, .wrl or .3ds")],
    scale: Annotated[
        float | None,
        typer.Option(metavar="NUMBER", help="Factor for lengths; for .glb, metres a unit, else guessed."),
    ] = None,
    up: Annotated[
        str | None, typer.Option(metavar="y|z", help="IN's upward axis; y is rotated to z.")
    ] = None,
) -> None:
    """Convert a mesh to the format of OUT's ending; warns of what that format cannot hold."""
    from robots.meshes.mesh import transformed_mesh
    from robots.meshes.read import read_mesh

    ending = target.suffix.lower()
    if ending not in _WRITERS:
        raise ConversionError(f"{target}: ending {ending!r} is not written; {', '.join(_WRITERS)} are")
    if up not in (None, "y", "z"):
        raise ConversionError(f"--up {up}: y or z is right")
    if scale is not None and not (isfinite(scale) and scale > 0):
        raise ConversionError(f"--scale {scale}: a number above 0 is right")
    if target.exists() and source.exists() and target.samefile(source):
        raise ConversionError(f"{target}: is the input file; name another output")
    mesh = read_mesh(source, _progress(source), within=source.absolute().parent)
    for warning in mesh.warnings:
        _warn(f"{source.name}: {warning}")
    if not mesh.parts and not mesh.wires:
        raise ConversionError(f"{source}: holds no geometry; nothing is written")
    placed = transformed_mesh(mesh, _placement(mesh, ending, scale, up))
    for loss in _losses(placed, ending):
        _warn(f"{target.name}: {loss}")
    try:
        files = _WRITERS[ending](placed, target)
    except ValueError as error:
        raise ConversionError(f"{target}: {error}") from None
    for path, content in files.items():
        _write(path, content)
    print(f"{target}: {placed.triangle_count} triangles")


def _placement(mesh: "Mesh", ending: str, scale: float | None, up: str | None) -> Any:
    """Return the transform to OUT's units and axes.

    GLB is in metres, from the file's own units or a guess, and the writer turns z up to y up; other formats
    keep units and axes unless options change them.
    """
    from robots.meshes.unit_guess import file_to_link, guess

    found = guess(mesh)
    if ending != ".glb":
        factor, axis = scale or 1.0, up or "z"
    else:
        factor, axis = scale or found.scale_m, up or found.up
        if scale is None or up is None:
            _warn(found.sentence)
    return file_to_link(type(found)(factor, axis, ""))


def _losses(mesh: "Mesh", ending: str) -> list[str]:
    losses = []
    if ending == ".stl":
        losses.append("STL holds shape only: colours, transparency and names are lost")
    if ending == ".ply":
        losses.append("PLY holds colours by vertex: names, shine and textures of materials are lost")
    if ending in (".wrl", ".3ds", ".obj") and any(part.colors is not None for part in mesh.parts):
        losses.append("colours of vertices are lost")
    if ending != ".glb" and mesh.wires:
        losses.append("lines and points are lost")
    return losses


def _glb(mesh: "Mesh", target: Path) -> dict[Path, bytes]:
    from robots.meshes.write_glb import glb_of

    return {target: glb_of(mesh)}


def _stl(mesh: "Mesh", target: Path) -> dict[Path, bytes]:
    from robots.meshes.write_others import write_stl

    return {target: write_stl(mesh)}


def _obj(mesh: "Mesh", target: Path) -> dict[Path, bytes]:
    from robots.meshes.write_others import write_obj

    library = target.with_suffix(".mtl")
    text, materials = write_obj(mesh, library.name)
    # Materials first, so that an .obj never names a file that is not there yet.
    return {library: materials.encode(), target: text.encode()}


def _ply(mesh: "Mesh", target: Path) -> dict[Path, bytes]:
    from robots.meshes.write_others import write_ply

    return {target: write_ply(mesh)}


def _vrml(mesh: "Mesh", target: Path) -> dict[Path, bytes]:
    from robots.meshes.vrml.write import write_vrml

    return {target: write_vrml(mesh, decimals=9).encode()}


def _3ds(mesh: "Mesh", target: Path) -> dict[Path, bytes]:
    from robots.meshes.three_ds.write import write_3ds

    return {target: write_3ds(mesh)}


_WRITERS: dict[str, Callable[["Mesh", Path], dict[Path, bytes]]] = {
    ".glb": _glb,
    ".stl": _stl,
    ".obj": _obj,
    ".ply": _ply,
    ".wrl": _vrml,
    ".3ds": _3ds,
}


def _write(path: Path, content: bytes) -> None:
    try:
        write_atomically(path, content, mode=0o666, fsync=False)
    except OSError as error:
        raise ConversionError(f"{path}: cannot be written: {error.strerror}") from None


def _progress(file: Path) -> "Progress | None":
    """Return a display of the percentage read, for a large file on a terminal."""
    if not sys.stderr.isatty() or not file.is_file() or file.stat().st_size < _LARGE_BYTES:
        return None

    def show(done: float) -> None:
        sys.stderr.write(f"\rreading {file.name}: {done:4.0%}" if done < 1 else "\r\x1b[K")
        sys.stderr.flush()

    return show


def _warn(text: str) -> None:
    print(f"robomesh: {text}", file=sys.stderr)


def _triple(values: Any) -> str:
    return "({:.6g}, {:.6g}, {:.6g})".format(*values)
