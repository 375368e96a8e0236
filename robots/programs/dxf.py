"""Conversion of a drawing's curves to a program of lines, as in the paper's path from CAD to motion.

LWPOLYLINE, POLYLINE    with their arcs
LINE, ARC, CIRCLE, ELLIPSE, SPLINE
                        joined where one ends and another begins
INSERT                  the curves of its block, once per row and column, also nested
"""

import importlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robots.kinematics.joints import FloatArray
from robots.programs import MOST_BYTES
from robots.programs.text import MOST_LINES, pose_of
from robots.programs.write import number, pose_words
from robots.schema.errors import ShapeError
from robots.schema.poses import rpy_rotation
from robots.schema.robot_toml import nearest
from robots.shapes.files.declared_size import content
from robots.shapes.files.dxf import UNITS_M, open_drawing

_CURVES = {"LINE", "LWPOLYLINE", "POLYLINE", "CIRCLE", "ARC", "ELLIPSE", "SPLINE"}
_MOST_CURVES = 5_000
# Curves and INSERTs that are drawn by blocks: a few kilobytes of nested blocks can draw billions.
_MOST_COPIES = 20_000
_MOST_NESTED = 32
# Far more points of a curve than a program can hold.
_MOST_POINTS = 100_000
# Ends within this distance are joined.
_JOINED_MM = 0.01


@dataclass(frozen=True, eq=False)
class _Drawn:
    """A curve of the drawing or of a block.

    Attributes:
        placement: (4, 4) from the block to the drawing, for rows of coordinates.
        layer: Its own, or on layer 0 of a block that of its INSERT.
        handles: Its own and those of the INSERTs that draw it.
    """

    entity: Any
    placement: FloatArray
    layer: str
    handles: frozenset[str]


@dataclass(frozen=True)
class DxfPath:
    """Selection of curves, and their placement.

    Attributes:
        layer: Take all curves of this layer; empty: of the only layer with curves.
        handle: Take the curve, or the curves of the INSERT, with this handle, unless empty.
        frame: Pose of the drawing in the arm's base frame: x y z [mm], roll pitch yaw [deg].
        tool: Roll, pitch and yaw of the tool in that frame [deg].
        approach_mm: Height above the curves, along the frame's z, at which the tool approaches and departs.
        tolerance_mm: Largest deviation of a curve from its straight parts.
        unit_mm: The drawing's unit if the file does not state it; 0: reject such a file.
    """

    layer: str = ""
    handle: str = ""
    frame: Sequence[float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    tool: Sequence[float] = (180.0, 0.0, 0.0)
    approach_mm: float = 50.0
    tolerance_mm: float = 0.1
    unit_mm: float = 0.0


_TOO_LARGE = "gives {count} points, more than a program can hold: use a larger tolerance, or one curve"


def program_from_dxf(path: Path, selection: DxfPath) -> str:
    """Return the text of a program that follows curves of a drawing, in the drawing's order.

    Raises:
        ShapeError: If the file is not DXF, does not have such curves, or they exceed the size of a program.
    """
    content(path)
    try:
        drawing, _ = open_drawing(path)
        unit_mm = UNITS_M.get(int(drawing.header.get("$INSUNITS", 0) or 0), 0.0) * 1000 or selection.unit_mm
        if not unit_mm:
            raise ShapeError(path, "does not state its unit ($INSUNITS); give it with --unit, in mm")
        which, selected = _selected(path, drawing, selection)
        curves, count = [], 0
        for each in selected:
            curves.append(_placed(path, each, selection.tolerance_mm / unit_mm) * unit_mm)
            count += len(curves[-1])
            if count > _MOST_POINTS:
                raise ShapeError(path, _TOO_LARGE.format(count=count))
    except ShapeError:
        raise
    except MemoryError as error:
        raise ShapeError(path, "needs more memory than is available") from error
    # ezdxf raises arbitrary exceptions on damaged files.
    except Exception as error:
        first = next(iter(str(error).splitlines()), "")[:200]
        raise ShapeError(path, f"cannot be read as DXF: {first or type(error).__name__}") from error
    chains = [_distinct(chain) for chain in _joined(curves)]
    chains = [chain for chain in chains if len(chain) > 1]
    if not chains:
        raise ShapeError(path, "its curves have no length")
    what = f"{path.name}, {which}: {len(chains)} path{'s' if len(chains) > 1 else ''}"
    comment = f"# {what}, curves flattened to {number(selection.tolerance_mm)} mm"
    # A file or layer name may contain a line break.
    lines = [" ".join(comment.split()), *_lines(chains, selection)]
    text = "".join(f"{line}\n" for line in lines)
    if len(text.encode()) > MOST_BYTES or len(lines) > MOST_LINES:
        count = sum(len(chain) for chain in chains)
        raise ShapeError(path, _TOO_LARGE.format(count=count))
    return text


def _selected(path: Path, drawing: Any, selection: DxfPath) -> tuple[str, list[_Drawn]]:
    """Return the name of the selection and its curves, in the drawing's order."""
    space = drawing.modelspace()
    _check_copies(path, space)
    curves = list(_drawn(path, space, np.eye(4), "", frozenset()))
    if selection.handle:
        found = [each for each in curves if selection.handle.lower() in each.handles]
        if not found:
            raise ShapeError(path, f"has no curve of handle {selection.handle!r} in its model space")
        return f"curve {selection.handle}", found
    layers = Counter(each.layer for each in curves)
    layer = selection.layer or (next(iter(layers)) if len(layers) == 1 else "")
    if not layer:
        known = ", ".join(f"{name} ({count})" for name, count in sorted(layers.items())[:20])
        raise ShapeError(path, f"no curves selected. Name a layer or a handle; curves: {known or 'none'}")
    found = [each for each in curves if each.layer.lower() == layer.lower()]
    if not found:
        hint = nearest(layer, sorted(layers)) if layers else "; it has no curves"
        raise ShapeError(path, f"has no curve on layer {layer!r}{hint}")
    if len(found) > _MOST_CURVES:
        raise ShapeError(path, f"has {len(found)} curves on layer {layer!r}; up to {_MOST_CURVES} are read")
    return f"layer {layer}", found


def _check_copies(path: Path, space: Any) -> None:
    """Count what blocks draw, without drawing it.

    Raises:
        ShapeError: If it is too much, or a block contains itself.
    """
    sizes: dict[str, tuple[int, int]] = {}

    def size(layout: Any, inside: tuple[str, ...]) -> tuple[int, int]:
        """Return the number of curves and INSERTs that a layout draws, and the depth of its blocks."""
        count, depth = 0, 0
        for entity in layout:
            count += bool(inside) and entity.dxftype() in _CURVES
            block = entity.block() if entity.dxftype() == "INSERT" else None
            if block is None:
                continue
            names = (*inside, block.name)
            if block.name in inside:
                raise ShapeError(path, f"block {block.name!r} contains itself: {' > '.join(names)}")
            if block.name not in sizes and len(names) <= _MOST_NESTED:
                sizes[block.name] = size(block, names)
            copies, below = sizes.get(block.name, (0, _MOST_NESTED))
            if (depth := max(depth, 1 + below)) > _MOST_NESTED:
                raise ShapeError(path, f"block {names[0]!r} is nested deeper than {_MOST_NESTED}")
            # ezdxf visits every row and column, also without a spacing.
            count += max(entity.dxf.row_count, 1) * max(entity.dxf.column_count, 1) * (1 + copies)
            if count > _MOST_COPIES:
                raise ShapeError(path, f"its blocks draw more than {_MOST_COPIES:,} curves and blocks")
        return count, depth

    size(space, ())


def _drawn(
    path: Path, layout: Any, placement: FloatArray, layer: str, handles: frozenset[str]
) -> Iterator[_Drawn]:
    """Yield the curves of a layout and of the blocks that it draws."""
    for entity in layout:
        if entity.dxftype() not in _CURVES | {"INSERT"}:
            continue
        own = layer if layer and entity.dxf.layer == "0" else str(entity.dxf.layer)
        here = handles | {str(entity.dxf.handle).lower()}
        if entity.dxftype() != "INSERT":
            yield _Drawn(entity, placement, own, here)
        elif (block := entity.block()) is not None:
            for one in entity.multi_insert() if entity.mcount > 1 else (entity,):
                inner = np.array(list(one.matrix44())).reshape(4, 4) @ placement
                if not np.isfinite(inner).all():
                    raise ShapeError(path, f"INSERT {entity.dxf.handle} has a value that is not finite")
                yield from _drawn(path, block, inner, own, here)


def _placed(path: Path, curve: _Drawn, tolerance: float) -> FloatArray:
    """Return the (m, 3) corners of a curve's straight parts, in the drawing and its unit."""
    turn = curve.placement[:3, :3]
    # No part deviates more than this many times as far as in the block.
    scale = max(float(np.linalg.norm(turn, 2)), 1e-9)
    placed: FloatArray = _flattened(path, curve.entity, tolerance / scale) @ turn + curve.placement[3, :3]
    return placed


def _flattened(path: Path, entity: Any, tolerance: float) -> FloatArray:
    """Return the (m, 3) corners of a curve's straight parts, where it is defined."""
    curve = importlib.import_module("ezdxf.path").make_path(entity)
    corners = np.array([(v.x, v.y, v.z) for v in curve.control_vertices()], dtype=np.float64).reshape(-1, 3)
    name = f"{entity.dxftype()} {entity.dxf.handle}"
    # ezdxf halves a curve until the parts are within the tolerance, which never ends for such values.
    if not np.isfinite(corners).all() or not len(corners):
        raise ShapeError(path, f"{name} has a point that is not finite")
    size = float(np.ptp(corners, axis=0).max())
    if size / max(tolerance, 1e-300) > 1e9:
        raise ShapeError(path, f"{name} is {size:.3g} units large: too large for its tolerance")
    points = []
    for piece in _pieces(entity, max(tolerance, size * 1e-6)):
        points.append(np.array([(point[0], point[1], point[2]) for point in piece], dtype=np.float64))
        if sum(map(len, points)) > _MOST_POINTS:
            raise ShapeError(path, f"{name} gives more than {_MOST_POINTS} points: use a larger tolerance")
    # The arcs of a polyline always run counter-clockwise, even where the polyline runs clockwise.
    return next(_joined(points, near=size * 1e-6))


def _pieces(entity: Any, tolerance: float) -> Iterator[Sequence[Any]]:
    """Yield the parts of a curve as points, within the tolerance; arcs are not replaced by Bézier curves."""
    match entity.dxftype():
        case "LINE":
            yield [entity.dxf.start, entity.dxf.end]
        case "LWPOLYLINE" | "POLYLINE":
            for each in entity.virtual_entities():
                yield from _pieces(each, tolerance)
        case _:
            yield list(entity.flattening(tolerance))


def _joined(curves: Sequence[FloatArray], *, near: float = _JOINED_MM) -> Iterator[FloatArray]:
    """Join curves that meet at their ends, reversing them where necessary."""
    rest = [curve for curve in curves if len(curve)]
    ends = np.array([(curve[0], curve[-1]) for curve in rest]).reshape(-1, 2, 3)
    for place, chain in enumerate(rest):
        if np.isinf(ends[place, 0, 0]):
            continue
        ends[place] = np.inf  # joined already
        # Extend the end, reverse the chain, then extend the beginning.
        for _ in range(2):
            while len(found := np.argwhere(np.linalg.norm(ends - chain[-1], axis=2) <= near)):
                index, side = found[0]
                ends[index] = np.inf
                chain = np.concatenate([chain, rest[index][::-1] if side else rest[index]])
            chain = chain[::-1]
        yield chain


def _distinct(chain: FloatArray) -> FloatArray:
    """Remove points that equal the previous one."""
    apart = np.linalg.norm(np.diff(chain, axis=0), axis=1) > _JOINED_MM / 10
    kept: FloatArray = chain[np.concatenate([[True], apart])]
    return kept


def _lines(chains: Sequence[FloatArray], selection: DxfPath) -> Iterator[str]:
    """Yield the definitions of all points, then the moves."""
    x, y, z, roll, pitch, yaw = selection.frame
    frame_to_base = pose_of(x, y, z, roll, pitch, yaw)
    tool = rpy_rotation(*np.radians(selection.tool).tolist())
    above = np.array([0.0, 0.0, selection.approach_mm])

    def point(name: str, place_mm: FloatArray) -> str:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = tool, place_mm / 1000
        return f"point {name} = pose {pose_words(frame_to_base @ pose)}"

    moves = []
    for path_number, chain in enumerate(chains, start=1):
        names = [f"p{path_number}-{index}" for index in range(1, len(chain) + 1)]
        begin, end = f"begin{path_number}", f"end{path_number}"
        yield point(begin, chain[0] + above)
        for name, place in zip(names, chain, strict=True):
            yield point(name, place)
        yield point(end, chain[-1] + above)
        moves += [
            f"move_joints {begin}" if path_number == 1 else f"move_line {begin}",
            *(f"move_line {name}" for name in names),
            f"move_line {end}",
        ]
    yield from moves
