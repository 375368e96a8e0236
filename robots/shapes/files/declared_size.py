"""The sizes, units and names that a shape file declares, read before a library reads the file.

A count that the file cannot hold is rejected before memory is allocated for it. The unit, the upward
axis and the names of textures and of other files are kept here, because the libraries drop them.
"""

import re
import struct
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote

from robots.schema.errors import ShapeError
from robots.schema.xml_text import XmlError, xml_text
from robots.shapes.files.text_repair import check_instances, counted_from_first, plain_text

# A robot's link is far smaller. The console reads uploaded files, so the limits must be firm.
MAX_BYTES = 1 << 30
# trimesh makes a `Trimesh` for each material, which takes milliseconds.
_MOST_MATERIALS = 2000


@dataclass(frozen=True)
class Declared:
    """The properties that a file declares.

    Attributes:
        unit_m: Length of the file's unit [m]; None if the file does not state one.
        up: Upward axis, "y" or "z"; empty if the file does not state one.
        textures: Image by material name.
        missing: Names of material files that do not exist or may not be read.
        files: Files that this file names, existing or not, in its folder or below.
        rewritten: Content to read instead of the file, if the libraries cannot read the file itself.
    """

    unit_m: float | None = None
    up: str = ""
    textures: Mapping[str, str] = field(default_factory=dict)
    missing: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()
    warnings: tuple[str, ...] = ()
    rewritten: bytes | None = None


def read_declared(path: Path, kind: str) -> Declared:
    """Return the properties that a file of this kind ("ply") declares.

    Raises:
        ShapeError: If the file cannot be opened, is too large, or declares more than it can hold.
    """
    data = content(path)
    reader = _READERS.get(kind)
    return reader(path, data) if reader is not None else Declared()


def content(path: Path) -> bytes:
    """Return a file's bytes.

    Raises:
        ShapeError: If it cannot be read, is empty, or is larger than MAX_BYTES.
    """
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise ShapeError(path, f"has {size >> 20} MiB; at most {MAX_BYTES >> 20} MiB are read")
        data = path.read_bytes()
    except OSError as error:
        raise ShapeError(path, f"cannot be read: {error.strerror}") from error
    if not data:
        raise ShapeError(path, "is empty")
    return data


def _stl(path: Path, data: bytes) -> Declared:
    if len(data) >= 84 and data[:5].lower() != b"solid":
        (count,) = struct.unpack_from("<I", data, 80)
        if 84 + 50 * count > len(data):
            raise ShapeError(
                path,
                f"declares {count} triangles, which take {50 * count} bytes; {len(data) - 84} follow",
                place="byte 80",
            )
    return Declared()


_SIZES = {"char": 1, "uchar": 1, "int8": 1, "uint8": 1, "short": 2, "ushort": 2, "int16": 2, "uint16": 2}
_SIZES |= {"int": 4, "uint": 4, "float": 4, "int32": 4, "uint32": 4, "float32": 4, "double": 8, "float64": 8}


def _ply(path: Path, data: bytes) -> Declared:
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise ShapeError(path, "is not a PLY file: one begins with 'ply' and has a line 'end_header'")
    needed = 0
    text = b"format ascii" in data[:end]
    count = 0
    for number, line in enumerate(data[:end].decode("latin-1").splitlines(), 1):
        words = line.split()
        if words[:1] == ["element"]:
            if len(words) != 3 or not (words[2].isascii() and words[2].isdigit()):
                raise ShapeError(
                    path, f"{line!r} must have the form 'element vertex 8'", place=f"line {number}"
                )
            count = int(words[2])
        elif words[:1] == ["property"] and len(words) >= 3:
            # A list takes at least the bytes of its count; a number in text takes a digit and a blank.
            needed += count * (2 if text else _SIZES.get(words[1] if words[1] != "list" else words[2], 1))
            if needed - 2 > len(data) - end:
                raise ShapeError(
                    path,
                    f"declares {count} rows; only {len(data) - end} bytes follow",
                    place=f"line {number}",
                )
    return Declared()


def _obj(path: Path, data: bytes) -> Declared:
    warnings: list[str] = []
    textures: dict[str, str] = {}
    missing: list[str] = []
    files: list[Path] = []
    text = plain_text(data)
    rewritten = counted_from_first(path, text)
    for found in _named("mtllib", text)[:100]:
        library = below(path, found)
        files += [library] if library is not None else []
        if library is not None and library.is_file():
            textures |= _mtl_textures(library)
        else:
            missing.append(found)
            warnings.append(f"materials: no file {found!r} in this file's folder; drawn grey")
    _check_obj_numbers(path, rewritten)
    names = set(_named("usemtl", rewritten))
    if len(names) > _MOST_MATERIALS:
        rewritten = re.sub(r"(?m)^[ \t]*usemtl[ \t].*$", "", rewritten)
        warnings.append(f"{len(names)} materials, more than {_MOST_MATERIALS}: all ignored, drawn grey")
    left_out = len(re.findall(r"(?m)^[ \t]*[lp][ \t]", text))
    if left_out:
        warnings.append(f"{left_out} lines or points are left out")
    return Declared(
        textures=textures,
        files=(*files, *textures_below(path, textures.values())),
        missing=tuple(missing),
        warnings=tuple(warnings),
        rewritten=None if rewritten.encode() == data else rewritten.encode(),
    )


def _named(keyword: str, text: str) -> list[str]:
    """Return the name in each line that begins with a keyword, without its outer blanks."""
    return [name.rstrip(" \t\r") for name in re.findall(rf"(?m)^[ \t]*{keyword}[ \t]+(\S.*)$", text)]


def _check_obj_numbers(path: Path, text: str) -> None:
    """Reject a face with a vertex number far above the count: trimesh would allocate up to that number.

    Raises:
        ShapeError: If there is one.
    """
    count = len(re.findall(r"(?m)^[ \t]*v[nt]?[ \t]", text))
    digits = len(str(count)) + 1
    found = re.search(rf"(?m)^[ \t]*f[ \t](?:[^\n]*[ \t/])?(\d{{{digits},}})", text)
    if found is not None:
        line = text.count("\n", 0, found.start(1)) + 1
        number = found[1][:20]
        raise ShapeError(
            path, f"a face uses vertex {number}; there are at most {count}", place=f"line {line}"
        )


def below(path: Path, address: str) -> Path | None:
    """Return the path that an address in a file names; None outside the file's folder.

    trimesh reads no files outside the folder either.
    """
    try:
        found = (path.parent / address.replace("\\", "/")).resolve()
        found.is_file()
    except (OSError, ValueError):  # the name is too long or has a zero byte
        return None
    return found if found.is_relative_to(path.parent.resolve()) else None


def textures_below(path: Path, textures: Iterable[str]) -> list[Path]:
    """Return the paths of textures in a file's folder or below."""
    places = (below(path, unquote(texture)) for texture in textures if ":" not in texture)
    return [place for place in places if place is not None]


def _mtl_textures(library: Path) -> dict[str, str]:
    name, textures = "", {}
    for line in library.read_text(encoding="utf-8", errors="replace").splitlines():
        words = line.split()
        if words[:1] == ["newmtl"]:
            name = " ".join(words[1:])
        elif len(words) > 1 and words[0].lower() == "map_kd":
            textures[name] = words[-1]
    return textures


def _dae(path: Path, data: bytes) -> Declared:
    try:
        text, notes = xml_text(data)
    except XmlError as error:
        raise ShapeError(path, str(error)) from None
    data = text.encode()
    if b"<!ENTITY" in data or b"<!DOCTYPE" in data:
        raise ShapeError(path, "has a DOCTYPE or ENTITY, which can expand without limit; remove it")
    if b"COLLADA" not in data[:4096]:
        raise ShapeError(path, "is not a COLLADA file: the first element must be COLLADA")
    unit = re.search(rb"<unit\b[^<>]*\bmeter\s*=\s*[\"']\s*([-+0-9.eE]+)", data)
    axis = re.search(rb"<up_axis>\s*([XYZ])_UP\s*</up_axis>", data)
    try:
        unit_m = float(unit.group(1)) if unit else 1.0
    except ValueError:
        unit_m = 1.0
    check_instances(path, data)
    letter = axis.group(1).decode().lower() if axis else "y"
    warnings = (*notes, *(("its upward axis is x: rotate the mesh by hand",) if letter == "x" else ()))
    return Declared(
        unit_m=unit_m if 0 < unit_m < 1e6 else 1.0,
        up="z" if letter == "x" else letter,
        warnings=warnings,
        rewritten=data,  # the bytes that were checked
    )


_READERS: Mapping[str, Callable[[Path, bytes], Declared]] = {
    "stl": _stl,
    "ply": _ply,
    "obj": _obj,
    "dae": _dae,
}
