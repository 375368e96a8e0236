"""`robomesh shapes`: what a file with shapes holds, and conversion to another format.

A command imports the readers and writers when it runs: with numpy they take half a second.
"""

import contextlib
from collections.abc import Callable
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from robomesh.files.atomic_write import write_atomically
from services.command_line.terminal.options import command_group
from services.command_line.terminal.output import print_json, print_line, progress
from services.errors import ServiceError

if TYPE_CHECKING:
    from robots.shapes.geometry import Geometry

# A smaller file is read before a progress display would be useful.
_LARGE_BYTES = 2_000_000
_MOST_COLORS = 20

app = command_group("shapes", "Files with shapes: inspect, convert.")


class ConversionError(ServiceError):
    """The file cannot be converted as requested."""


@app.command()
def info(
    file: Annotated[Path, typer.Argument(metavar="FILE")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, in the file's own units.")] = False,
) -> None:
    """Show triangles, bounds and materials of a file, in its own units and axes."""
    from robots.descriptions.summary import geometry_summary
    from robots.shapes.files.unit_guess import guess

    geometry = _read(file)
    summary = geometry_summary(geometry)
    if as_json:
        print_json(summary)
        return
    print_line(f"{file.name}: {summary['triangles']} triangles")
    print_line(f"  from {_triple(summary['min'])} to {_triple(summary['max'])}, in the file's own units")
    print_line(f"  {guess(geometry).sentence}")
    print_line(f"  materials: {', '.join(filter(None, summary['materials'])) or 'none named'}")
    listed = summary["colors"][:_MOST_COLORS]
    more = len(summary["colors"]) - len(listed)
    print_line(f"  colors: {', '.join(listed) or 'none'}{f' and {more} more' if more else ''}")
    for warning in summary["warnings"]:
        print_line(f"  warning: {warning}")


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
    """Convert shapes to the format of OUT's ending; warns of what that format cannot hold."""
    from robots.shapes.geometry import transformed_geometry

    ending = target.suffix.lower()
    if ending not in _WRITERS:
        raise ConversionError(f"{target}: ending {ending!r} is unknown; must be one of {', '.join(_WRITERS)}")
    if up not in (None, "y", "z"):
        raise ConversionError(f"--up {up}: must be y or z")
    if scale is not None and not (isfinite(scale) and scale > 0):
        raise ConversionError(f"--scale {scale}: must be a number above 0")
    if target.exists() and source.exists() and target.samefile(source):
        raise ConversionError(f"{target}: is the input file; name another output")
    geometry = _read(source)
    for warning in geometry.warnings:
        _warn(f"{source.name}: {warning}")
    if not geometry.parts and not geometry.wires:
        raise ConversionError(f"{source}: holds no geometry; nothing is written")
    placed = transformed_geometry(geometry, _placement(geometry, ending, scale, up))
    for loss in _losses(placed, ending):
        _warn(f"{target.name}: {loss}")
    try:
        files = _WRITERS[ending](placed, target)
    except ValueError as error:
        raise ConversionError(f"{target}: {error}") from None
    for path, content in files.items():
        _write(path, content)
    print_line(f"{target}: {placed.triangle_count} triangles")


def _placement(geometry: "Geometry", ending: str, scale: float | None, up: str | None) -> Any:
    """Return the transform to OUT's units and axes.

    GLB is in metres, from the file's own units or a guess, and the writer turns z up to y up; other formats
    keep units and axes unless options change them.
    """
    from robots.shapes.files.unit_guess import file_to_link, guess

    found = guess(geometry)
    if ending != ".glb":
        factor, axis = scale or 1.0, up or "z"
    else:
        factor, axis = scale or found.scale_m, up or found.up
        if scale is None or up is None:
            _warn(found.sentence)
    return file_to_link(type(found)(factor, axis, ""))


def _losses(geometry: "Geometry", ending: str) -> list[str]:
    losses = []
    if ending == ".stl":
        losses.append("STL holds shape only: colours, transparency and names are lost")
    if ending == ".ply":
        losses.append("PLY holds colours by vertex: names, shine and textures of materials are lost")
    if ending in (".wrl", ".3ds", ".obj") and any(part.colors is not None for part in geometry.parts):
        losses.append("colours of vertices are lost")
    if ending != ".glb" and geometry.wires:
        losses.append("lines and points are lost")
    return losses


def _glb(geometry: "Geometry", target: Path) -> dict[Path, bytes]:
    from robots.shapes.files.write_glb import glb_of

    return {target: glb_of(geometry)}


def _stl(geometry: "Geometry", target: Path) -> dict[Path, bytes]:
    from robots.shapes.files.write_others import write_stl

    return {target: write_stl(geometry)}


def _obj(geometry: "Geometry", target: Path) -> dict[Path, bytes]:
    from robots.shapes.files.write_others import write_obj

    library = target.with_suffix(".mtl")
    text, materials = write_obj(geometry, library.name)
    # Materials first, so that an .obj never names a file that is not there yet.
    return {library: materials.encode(), target: text.encode()}


def _ply(geometry: "Geometry", target: Path) -> dict[Path, bytes]:
    from robots.shapes.files.write_others import write_ply

    return {target: write_ply(geometry)}


def _vrml(geometry: "Geometry", target: Path) -> dict[Path, bytes]:
    from robots.shapes.files.vrml.write import write_vrml

    return {target: write_vrml(geometry, decimals=9).encode()}


def _3ds(geometry: "Geometry", target: Path) -> dict[Path, bytes]:
    from robots.shapes.files.three_ds.write import write_3ds

    return {target: write_3ds(geometry)}


_WRITERS: dict[str, Callable[["Geometry", Path], dict[Path, bytes]]] = {
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


def _read(file: Path) -> "Geometry":
    """Read a file, with a progress bar for a large file."""
    from robots.shapes.files.read import read_geometry

    large = file.is_file() and file.stat().st_size >= _LARGE_BYTES
    with progress(f"reading {file.name}") if large else contextlib.nullcontext() as show:
        return read_geometry(file, show, within=file.absolute().parent)


def _warn(text: str) -> None:
    print_line(f"robomesh: {text}", err=True)


def _triple(values: Any) -> str:
    return "({:.6g}, {:.6g}, {:.6g})".format(*values)
