"""A drawing's curves as a program of lines: the paper's way from CAD to motion.

LWPOLYLINE, POLYLINE    with their arcs
LINE, ARC, CIRCLE, ELLIPSE, SPLINE
                        joined where one ends and another begins
"""

import importlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robots.errors import MeshError
from robots.joints import FloatArray
from robots.meshes.declared_size import content
from robots.meshes.dxf import UNITS_M, open_drawing
from robots.poses import rpy_rotation
from robots.programs.text import MOST_BYTES, MOST_LINES, pose_of
from robots.programs.write import number, pose_words
from robots.schema import nearest

_CURVES = {"LINE", "LWPOLYLINE", "POLYLINE", "CIRCLE", "ARC", "ELLIPSE", "SPLINE"}
_MOST_CURVES = 5_000
# A curve of so many points is no drawing that a person made; and far more than a program takes.
_MOST_POINTS = 100_000
# Ends nearer than this are one place.
_JOINED_MM = 0.01


@dataclass(frozen=True)
class DxfPath:
    """Which curves, and where they lie.

    Attributes:
        layer: All curves of this layer; or empty.
        handle: The one curve of this handle; or empty.
        frame: Of the drawing in the arm's base frame: x y z [mm], roll pitch yaw [deg].
        tool: Roll, pitch and yaw of the tool in that frame [deg].
        approach_mm: How far above the curves, along the frame's z, the tool comes and goes.
        tolerance_mm: How far a curve may be from the straight parts that stand for it.
        unit_mm: The drawing's unit, where it does not say it itself; 0: refuse it then.
    """

    layer: str = ""
    handle: str = ""
    frame: Sequence[float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    tool: Sequence[float] = (180.0, 0.0, 0.0)
    approach_mm: float = 50.0
    tolerance_mm: float = 0.1
    unit_mm: float = 0.0


def program_from_dxf(path: Path, asked: DxfPath) -> str:
    """The text of a program that follows curves of a drawing, one after the other as they are drawn.

    Raises:
        MeshError: If it is no DXF file, has no such curves, or they come to more than a program holds.
    """
    content(path)
    try:
        drawing, _ = open_drawing(path)
        unit_mm = UNITS_M.get(int(drawing.header.get("$INSUNITS", 0) or 0), 0.0) * 1000 or asked.unit_mm
        if not unit_mm:
            raise MeshError(path, "does not say its unit ($INSUNITS): give it with --unit, in mm")
        entities = _entities(path, drawing, asked)
        curves = [_flattened(path, each, asked.tolerance_mm / unit_mm) * unit_mm for each in entities]
    except MeshError:
        raise
    except MemoryError as error:
        raise MeshError(path, "needs more memory than there is") from error
    # ezdxf raises whatever its code runs into on broken files.
    except Exception as error:
        first = next(iter(str(error).splitlines()), "")[:200]
        raise MeshError(path, f"is no DXF that can be read: {first or type(error).__name__}") from error
    chains = [_distinct(chain) for chain in _joined(curves)]
    chains = [chain for chain in chains if len(chain) > 1]
    if not chains:
        raise MeshError(path, "its curves have no length")
    which = f"curve {asked.handle}" if asked.handle else f"layer {asked.layer}"
    what = f"{path.name}, {which}: {len(chains)} path{'s' if len(chains) > 1 else ''}"
    comment = f"# {what}, curves flattened to {number(asked.tolerance_mm)} mm"
    # A name may hold a line break.
    lines = [" ".join(comment.split()), *_lines(chains, asked)]
    text = "".join(f"{line}\n" for line in lines)
    if len(text.encode()) > MOST_BYTES or len(lines) > MOST_LINES:
        count = sum(len(chain) for chain in chains)
        raise MeshError(
            path, f"comes to {count} points, more than a program holds: take a larger tolerance, or one curve"
        )
    return text


def _entities(path: Path, drawing: Any, asked: DxfPath) -> list[Any]:
    """The curves that are asked for, in the order of the drawing."""
    curves = [entity for entity in drawing.modelspace() if entity.dxftype() in _CURVES]
    if asked.handle:
        found = [each for each in curves if str(each.dxf.handle).lower() == asked.handle.lower()]
        if not found:
            raise MeshError(path, f"has no curve of handle {asked.handle!r} in its model space")
        return found
    layers = Counter(str(each.dxf.layer) for each in curves)
    if not asked.layer:
        there = ", ".join(f"{name} ({count})" for name, count in sorted(layers.items())[:20])
        raise MeshError(
            path, f"which curves? Name a layer or a handle; there are curves on {there or 'none'}"
        )
    found = [each for each in curves if str(each.dxf.layer).lower() == asked.layer.lower()]
    if not found:
        hint = nearest(asked.layer, sorted(layers)) if layers else "; it has none at all"
        raise MeshError(path, f"has no curve on layer {asked.layer!r}{hint}")
    if len(found) > _MOST_CURVES:
        raise MeshError(
            path, f"has {len(found)} curves on layer {asked.layer!r}; up to {_MOST_CURVES} are read"
        )
    return found


def _flattened(path: Path, entity: Any, tolerance: float) -> FloatArray:
    """(m, 3) corners of the straight parts of a curve, in the drawing's unit."""
    curve = importlib.import_module("ezdxf.path").make_path(entity)
    corners = np.array([(v.x, v.y, v.z) for v in curve.control_vertices()], dtype=np.float64).reshape(-1, 3)
    what = f"{entity.dxftype()} {entity.dxf.handle}"
    # Flattened by halves until it is near enough: that never ends where nothing is near.
    if not np.isfinite(corners).all() or not len(corners):
        raise MeshError(path, f"{what} has a point that is not finite")
    size = float(np.ptp(corners, axis=0).max())
    if size / max(tolerance, 1e-300) > 1e9:
        raise MeshError(path, f"{what} is {size:.3g} units large: too large for its tolerance")
    points = []
    for piece in _pieces(entity, max(tolerance, size * 1e-6)):
        points.append(np.array([(point[0], point[1], point[2]) for point in piece], dtype=np.float64))
        if sum(map(len, points)) > _MOST_POINTS:
            raise MeshError(path, f"{what} comes to more than {_MOST_POINTS} points: take a larger tolerance")
    # An arc is drawn one way round, whichever way its polyline goes.
    return next(_joined(points, near=size * 1e-6))


def _pieces(entity: Any, tolerance: float) -> Iterator[Sequence[Any]]:
    """The parts of a curve as points, none farther from it than the tolerance; arcs are none of Bézier's."""
    match entity.dxftype():
        case "LINE":
            yield [entity.dxf.start, entity.dxf.end]
        case "LWPOLYLINE" | "POLYLINE":
            for each in entity.virtual_entities():
                yield from _pieces(each, tolerance)
        case _:
            yield list(entity.flattening(tolerance))


def _joined(curves: Sequence[FloatArray], *, near: float = _JOINED_MM) -> Iterator[FloatArray]:
    """Curves that begin where another ends, as one; each way round."""
    rest = [curve for curve in curves if len(curve)]
    while rest:
        chain = rest.pop(0)
        # First what goes on from its end, then what leads to its beginning.
        for _ in range(2):
            while (found := _at_end(chain[-1], rest, near)) is not None:
                index, turned = found
                more = rest.pop(index)
                chain = np.concatenate([chain, more[::-1] if turned else more])
            chain = chain[::-1]
        yield chain


def _at_end(end: FloatArray, curves: Sequence[FloatArray], near: float) -> tuple[int, bool] | None:
    """The first curve that begins at a place, or ends there and is to be turned round."""
    if not curves:
        return None
    begins = np.array([curve[0] for curve in curves])
    ends = np.array([curve[-1] for curve in curves])
    here = np.array([np.linalg.norm(side - end, axis=1) <= near for side in (begins, ends)])
    found = np.flatnonzero(here.any(axis=0))
    return (int(found[0]), not here[0, found[0]]) if len(found) else None


def _distinct(chain: FloatArray) -> FloatArray:
    """Without points that stand where the one before does."""
    apart = np.linalg.norm(np.diff(chain, axis=0), axis=1) > _JOINED_MM / 10
    kept: FloatArray = chain[np.concatenate([[True], apart])]
    return kept


def _lines(chains: Sequence[FloatArray], asked: DxfPath) -> Iterator[str]:
    """Definitions of all points, then the moves."""
    x, y, z, roll, pitch, yaw = asked.frame
    frame_to_base = pose_of(x, y, z, roll, pitch, yaw)
    tool = rpy_rotation(*np.radians(asked.tool).tolist())
    above = np.array([0.0, 0.0, asked.approach_mm])

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
