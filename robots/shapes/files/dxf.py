"""DXF reader: the model space of a file that ezdxf has parsed, with blocks expanded.

    3DFACE, SOLID, TRACE, POLYLINE (polyface, polygon mesh), MESH     triangles
    LINE, LWPOLYLINE, POLYLINE, CIRCLE, ARC, ELLIPSE, SPLINE, POINT   wires
    INSERT                                                            its block, once per row and column
    3DSOLID, BODY, REGION, SURFACE                                    named in a warning: they are ACIS

A colour is the entity's (true colour, or index), its layer's (BYLAYER) or its INSERT's (BYBLOCK).
"""

import importlib
import logging
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from robomesh.extras import is_missing, missing
from robots.schema.errors import ShapeError
from robots.shapes.files.declared_size import content
from robots.shapes.geometry import Color, FloatArray, Geometry, IndexArray, Material, Part, Wire, welded
from robots.shapes.normals import creased
from robots.shapes.polygons import Effort, ears

MAX_ENTITIES = 1_000_000
MAX_COPIES = 20_000  # of blocks: ezdxf takes about a millisecond for each
# In copies of blocks: they can draw the points of a small file thousands of times, 10 us for each.
MAX_COPIED_POINTS = 2_000_000
MAX_DEPTH = 32
_MOST_BROKEN = 20  # broken entities named in warnings
_CREASE = np.radians(30)
_BYBLOCK, _BYLAYER = 0, 256
_CURVES = {"LINE", "LWPOLYLINE", "POLYLINE", "CIRCLE", "ARC", "ELLIPSE", "SPLINE"}
_FLAT = {"3DFACE", "SOLID", "TRACE"}
_READ = {"INSERT", "MESH", "POINT"} | _CURVES | _FLAT
_ACIS = {"3DSOLID", "BODY", "REGION", "SURFACE", "EXTRUDEDSURFACE", "LOFTEDSURFACE", "REVOLVEDSURFACE"}
# $INSUNITS [m]; 0 means unitless.
UNITS_M = {1: 0.0254, 2: 0.3048, 4: 0.001, 5: 0.01, 6: 1.0, 7: 1000.0, 8: 2.54e-8, 9: 2.54e-5, 10: 0.9144}
UNITS_M |= {11: 1e-10, 12: 1e-9, 13: 1e-6, 14: 0.1}


@dataclass(frozen=True)
class _Appearance:
    """The layer and colour of an entity; an INSERT's replace layer 0 and BYBLOCK in its block."""

    layer: str = "0"
    color: Color = (0.8, 0.8, 0.8)
    transparency: float = 0.0

    @property
    def material(self) -> Material:
        return Material(self.layer, diffuse=self.color, transparency=self.transparency)


@dataclass
class _Found:
    polygons: dict[_Appearance, list[FloatArray]] = field(default_factory=dict)
    lines: dict[_Appearance, list[FloatArray]] = field(default_factory=dict)
    points: dict[_Appearance, list[FloatArray]] = field(default_factory=dict)
    left_out: Counter[str] = field(default_factory=Counter)
    undrawn: dict[str, Counter[str]] = field(default_factory=dict)  # by block
    broken: dict[str, str] = field(default_factory=dict)
    entities: int = 0
    copies: int = 0
    copied_points: int = 0

    def copied(self, path: Path, points: int) -> None:
        """Count points of a block's copy.

        Raises:
            ShapeError: If there are too many.
        """
        self.copied_points += points
        if self.copied_points > MAX_COPIED_POINTS:
            raise ShapeError(path, f"copies of blocks have more than {MAX_COPIED_POINTS} points")


def read_dxf(path: Path) -> Geometry:
    """Return the faces, lines and points of a .dxf file, in the file's units and axes.

    Raises:
        ShapeError: If it is not a DXF file, or is too damaged for ezdxf to recover.
    """
    size_bytes = len(content(path))
    try:
        drawing, warnings = open_drawing(path)
        found = _Found()
        for entity in drawing.modelspace():
            _walk(path, drawing, entity, _Appearance(), found, 0)
        effort = Effort()
        effort.read(size_bytes)
        effort.grant(sum(len(polygon) for polygons in found.polygons.values() for polygon in polygons))
        parts = [_part(appearance, polygons, effort) for appearance, polygons in found.polygons.items()]
        wires = [_lines(appearance, runs) for appearance, runs in found.lines.items()]
        wires += [_points(appearance, points) for appearance, points in found.points.items()]
        units = int(drawing.header.get("$INSUNITS", 0) or 0)
    except ShapeError:
        raise
    except MemoryError as error:
        raise ShapeError(path, "needs more memory than is available") from error
    # ezdxf raises arbitrary exceptions for damaged files.
    except Exception as error:
        first = next(iter(str(error).splitlines()), "")[:200]
        raise ShapeError(path, f"cannot be read as DXF: {first or type(error).__name__}") from error
    shapes: list[Part | Wire] = [*parts, *wires]
    for shape in shapes:
        if not np.isfinite(shape.vertices).all():
            raise ShapeError(path, f"layer {shape.name!r} has a point with a non-finite coordinate")
    warnings += _left_out(found.left_out)
    warnings += [f"{what} left out: {reason}" for what, reason in found.broken.items()]
    if effort.spent:
        warnings.append("concave faces take too long to triangulate; some are drawn beyond their outline")
    if not shapes:
        warnings.append("has no shape that can be drawn")
    return Geometry(
        tuple(part for part in parts if len(part.triangles)),
        tuple(wires),
        warnings=tuple(warnings),
        unit_m=UNITS_M.get(units),
        up="z",
    )


def open_drawing(path: Path) -> tuple[Any, list[str]]:
    """Return ezdxf's drawing and warnings about the file; any exception of ezdxf passes through.

    Raises:
        ShapeError: If ezdxf is not installed.
    """
    if is_missing("ezdxf"):
        raise ShapeError(path, missing("ezdxf"))
    ezdxf = _ezdxf()
    errors: Any = importlib.import_module("ezdxf.lldxf.const")
    logging.getLogger("ezdxf").setLevel(logging.CRITICAL)
    try:
        return ezdxf.readfile(path), []
    except (errors.DXFError, UnicodeDecodeError, ValueError, KeyError):
        recover: Any = importlib.import_module("ezdxf.recover")
        drawing, _ = recover.readfile(path)
        return drawing, ["is damaged; only what ezdxf could recover is read"]


def _ezdxf() -> Any:
    """Import ezdxf with a temporary cache folder.

    At its first import ezdxf would write a list of the machine's fonts to the user's cache.
    """
    if "ezdxf" in sys.modules:
        return sys.modules["ezdxf"]
    before = os.environ.get("XDG_CACHE_HOME")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        try:
            return importlib.import_module("ezdxf")
        finally:
            if before is None:
                del os.environ["XDG_CACHE_HOME"]
            else:
                os.environ["XDG_CACHE_HOME"] = before


def _left_out(counts: Counter[str]) -> list[str]:
    warnings = []
    solids = {name: count for name, count in counts.items() if name in _ACIS}
    if solids:
        listed = ", ".join(f"{count} {name}" for name, count in sorted(solids.items()))
        warnings.append(f"{listed} left out: ACIS shapes are not read; export STEP or STL")
    others = sorted(set(counts) - set(solids))
    if others:
        warnings.append(f"left out: {', '.join(f'{counts[name]} {name}' for name in others[:20])}")
    return warnings


def _walk(path: Path, drawing: Any, entity: Any, above: _Appearance, found: _Found, depth: int) -> None:
    found.entities += 1
    if found.entities > MAX_ENTITIES:
        raise ShapeError(path, f"draws more than {MAX_ENTITIES} entities, with blocks expanded")
    if depth > MAX_DEPTH:
        raise ShapeError(
            path, f"INSERT {entity.dxf.name!r} is nested deeper than {MAX_DEPTH}, or contains itself"
        )
    try:
        _draw(path, drawing, entity, above, found, depth)
    except (ShapeError, MemoryError, RecursionError):
        raise
    # ezdxf raises arbitrary exceptions; one broken entity must not make the whole file unreadable.
    except Exception as error:
        if len(found.broken) < _MOST_BROKEN:
            reason = next(iter(str(error).splitlines()), "")[:200] or type(error).__name__
            found.broken[f"{entity.dxftype()} {entity.dxf.handle}"] = f"it is broken: {reason}"


def _draw(path: Path, drawing: Any, entity: Any, above: _Appearance, found: _Found, depth: int) -> None:
    kind = entity.dxftype()
    # Before the layer is read: some entities, for example ACAD_TABLE, have none in ezdxf.
    if kind not in _READ:
        found.left_out[kind] += 1
        return
    appearance = _appearance(drawing, entity, above)
    if depth > 0:
        found.copied(path, _point_count(entity, kind))
    if kind == "INSERT":
        undrawn = _undrawn(entity, found)
        for one in _copies(path, entity, found):
            found.left_out += undrawn
            for child in one.virtual_entities(skipped_entity_callback=lambda e, _: _skip(e, found)):
                _walk(path, drawing, child, appearance, found, depth + 1)
    elif kind in _FLAT:
        found.polygons.setdefault(appearance, []).append(_array(entity.wcs_vertices()))
    elif kind == "MESH":
        corners = _array(entity.vertices)
        for face in entity.faces:
            found.polygons.setdefault(appearance, []).append(corners[list(face)])
    elif kind == "POLYLINE" and (entity.is_poly_face_mesh or entity.is_polygon_mesh):
        for face in entity.virtual_entities():
            found.polygons.setdefault(appearance, []).append(_array(face.wcs_vertices()))
    elif kind in _CURVES:
        curve = importlib.import_module("ezdxf.path").make_path(entity)
        corners = _array(curve.control_vertices())
        size = max(_size(corners), 1e-9)
        # `flattening` bisects until it is close enough, which never ends for a non-finite point.
        if not np.isfinite(size):
            raise ShapeError(
                path, f"{kind} on layer {appearance.layer!r} has a point with a non-finite coordinate"
            )
        found.lines.setdefault(appearance, []).append(_array(curve.flattening(size / 200)))
    else:
        found.points.setdefault(appearance, []).append(_array([entity.dxf.location]))


def _undrawn(insert: Any, found: _Found) -> Counter[str]:
    """Remove the entities that are not drawn from a block; return their numbers.

    ezdxf would copy them with each INSERT of the block: a hatch of 20,000 points, 20,000 times.
    """
    block = insert.block()
    if block is None:
        return Counter()
    if block.name not in found.undrawn:
        undrawn = [each for each in block if each.dxftype() not in _READ]
        found.undrawn[block.name] = Counter(each.dxftype() for each in undrawn)
        for each in undrawn:
            each.destroy()
        block.purge()
    return found.undrawn[block.name]


def _skip(entity: Any, found: _Found) -> None:
    found.left_out[entity.dxftype()] += 1


def _copies(path: Path, insert: Any, found: _Found) -> Iterator[Any]:
    # ezdxf visits every row and column, also without a spacing.
    count = insert.dxf.row_count * insert.dxf.column_count if insert.mcount > 1 else 1
    found.copies += count
    if found.copies > MAX_COPIES:
        raise ShapeError(
            path,
            f"INSERT {insert.dxf.name!r}: {found.copies} copies of blocks; at most {MAX_COPIES} are read",
        )
    return iter(insert.multi_insert()) if count > 1 else iter([insert])


def _appearance(drawing: Any, entity: Any, above: _Appearance) -> _Appearance:
    layer = above.layer if entity.dxf.layer == "0" else entity.dxf.layer
    index = entity.dxf.get("color", _BYLAYER)
    if entity.dxf.hasattr("true_color"):
        color = _rgb(entity.dxf.true_color)
    elif index == _BYBLOCK:
        color = above.color
    else:
        color = _layer_color(drawing, layer) if index == _BYLAYER else _indexed(index)
    transparency = float(entity.transparency)
    if getattr(entity, "is_transparency_by_block", False):
        transparency = above.transparency
    return _Appearance(layer, color, min(max(transparency, 0.0), 1.0))


def _layer_color(drawing: Any, name: str) -> Color:
    if not drawing.layers.has_entry(name):
        return 0.8, 0.8, 0.8
    layer = drawing.layers.get(name)
    if layer.dxf.hasattr("true_color"):
        return _rgb(layer.dxf.true_color)
    return _indexed(abs(layer.dxf.color))  # negative: the layer is off


def _indexed(index: int) -> Color:
    colors: Any = importlib.import_module("ezdxf.colors")
    # 7 is black or white, the opposite of the background; neither shows a shape well.
    if not 0 < index < 256 or index == 7:
        return 0.8, 0.8, 0.8
    red, green, blue = colors.aci2rgb(index)
    return red / 255, green / 255, blue / 255


def _rgb(value: int) -> Color:
    return (value >> 16 & 255) / 255, (value >> 8 & 255) / 255, (value & 255) / 255


def _point_count(entity: Any, kind: str) -> int:
    if kind == "MESH":
        return len(entity.vertices) + sum(map(len, entity.faces))
    if kind in {"LWPOLYLINE", "POLYLINE"}:
        return len(entity)
    return len(entity.control_points) + len(entity.fit_points) if kind == "SPLINE" else 1


def _array(points: Any) -> FloatArray:
    return np.array([(p[0], p[1], p[2]) for p in points], dtype=np.float64).reshape(-1, 3)


def _size(points: FloatArray) -> float:
    return float(np.ptp(points, axis=0).max()) if len(points) else 0.0


def _part(appearance: _Appearance, polygons: list[FloatArray], effort: Effort) -> Part:
    corners, triangles, count = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
    for polygon in polygons:
        if len(polygon) < 3:
            continue
        if len(polygon) == 3:
            cut = np.array([[0, 1, 2]])
        elif np.isfinite(polygon).all():
            cut = ears(polygon, effort)
        else:
            cut = np.zeros((0, 3), dtype=np.int64)
        corners.append(polygon)
        triangles.append(cut + count)
        count += len(polygon)
    made = creased(*welded(np.concatenate(corners), np.concatenate(triangles)), _CREASE)
    # DXF does not define which side of a face is outside.
    return Part(appearance.layer, appearance.material, *made, two_sided=True)


def _lines(appearance: _Appearance, runs: list[FloatArray]) -> Wire:
    pairs: list[IndexArray] = []
    start = 0
    for run in runs:
        steps = np.arange(start, start + len(run) - 1, dtype=np.int64)
        pairs.append(np.column_stack([steps, steps + 1]))
        start += len(run)
    return Wire(appearance.layer, appearance.material, np.concatenate(runs), np.concatenate(pairs))


def _points(appearance: _Appearance, points: list[FloatArray]) -> Wire:
    none = np.zeros((0, 2), dtype=np.int64)
    return Wire(appearance.layer, appearance.material, np.concatenate(points), none)
