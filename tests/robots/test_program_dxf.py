"""Drawings as programs: the drawn points, placed by the frame."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from ezdxf.document import Drawing

from robots.descriptions.description import load
from robots.kinematics.joints import joints_of
from robots.programs.dxf import DxfPath, program_from_dxf
from robots.programs.statements import MoveJoints, MoveLine
from robots.programs.text import parse_program, pose_of
from robots.schema.errors import ShapeError

JOINTS = joints_of(load("pt600"))
SQUARE = [(0.0, 0.0), (100.0, 0.0), (100.0, 50.0), (0.0, 50.0)]
ASKED = DxfPath(layer="cut", approach_mm=20.0)


def drawn(folder: Path, unit: int = 4) -> Path:
    """Draw a closed square on "cut", a chain in arbitrary order on "seam", a circle on "hole"."""
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = unit
    space = drawing.modelspace()
    space.add_lwpolyline(SQUARE, close=True, dxfattribs={"layer": "cut"})
    space.add_line((10, 0), (20, 0), dxfattribs={"layer": "seam"})
    space.add_line((20, 10), (20, 0), dxfattribs={"layer": "seam"})
    space.add_line((0, 0), (10, 0), dxfattribs={"layer": "seam"})
    space.add_circle((5, 5), 40, dxfattribs={"layer": "hole"})
    path = folder / "part.dxf"
    drawing.saveas(path)
    return path


def moves(text: str) -> list[tuple[type, np.ndarray]]:
    """Return each move and its target: (4, 4) [m]."""
    return [(type(each), each.target.tool_to_base) for each in parse_program(text, JOINTS).statements]


def test_polyline_becomes_lines_through_its_points(tmp_path: Path) -> None:
    frame = (400.0, 100.0, 250.0, 0.0, 90.0, 30.0)
    found = moves(program_from_dxf(drawn(tmp_path), replace(ASKED, frame=frame, tool=(180.0, 0.0, 45.0))))
    assert [kind for kind, _ in found] == [MoveJoints, *[MoveLine] * 6]
    corners = [*SQUARE, SQUARE[0]]
    wanted = [(*SQUARE[0], 20.0), *((x, y, 0.0) for x, y in corners), (*SQUARE[0], 20.0)]
    for (_, pose), (x, y, z) in zip(found, wanted, strict=True):
        assert pose == pytest.approx(pose_of(*frame) @ pose_of(x, y, z, 180.0, 0.0, 45.0), abs=1e-8)


def test_lines_are_joined_in_either_direction(tmp_path: Path) -> None:
    found = moves(program_from_dxf(drawn(tmp_path), replace(ASKED, layer="SEAM", approach_mm=0.0)))
    places = [(1000 * pose[:2, 3]).round(6).tolist() for _, pose in found[1:-1]]
    assert places == [[0, 0], [10, 0], [20, 0], [20, 10]]


def test_circle_is_followed_within_its_tolerance(tmp_path: Path) -> None:
    text = program_from_dxf(drawn(tmp_path), replace(ASKED, layer="hole", tolerance_mm=0.5))
    places = np.array([1000 * pose[:2, 3] - 5 for _, pose in moves(text)[1:-1]])
    assert np.linalg.norm(places, axis=1) == pytest.approx(40.0, abs=1e-6)
    assert places[0] == pytest.approx(places[-1])
    middles = np.linalg.norm((places[:-1] + places[1:]) / 2, axis=1)
    assert 39.5 <= middles.min() < 39.95
    finer = program_from_dxf(drawn(tmp_path), replace(ASKED, layer="hole", tolerance_mm=0.05))
    assert len(moves(finer)) > len(places) + 2


@pytest.mark.parametrize("bulge", [1.0, -1.0])
def test_arcs_follow_their_polylines_direction(tmp_path: Path, bulge: float) -> None:
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = 4
    corners = [(0, 0, 0), (50, 0, bulge), (50, 80, 0), (0, 80, 0)]
    drawing.modelspace().add_lwpolyline(corners, format="xyb", dxfattribs={"layer": "cut"})
    drawing.saveas(tmp_path / "part.dxf")
    places = [1000 * pose[:2, 3] for _, pose in moves(program_from_dxf(tmp_path / "part.dxf", ASKED))[1:-1]]
    assert np.array(places[:2]) == pytest.approx(np.array([[0, 0], [50, 0]]), abs=1e-6)
    assert np.array(places[-2:]) == pytest.approx(np.array([[50, 80], [0, 80]]), abs=1e-6)
    arc = np.array(places[1:-1]) - (50, 40)
    assert np.linalg.norm(arc, axis=1) == pytest.approx(40.0, abs=1e-5)
    assert (np.diff(arc[:, 1]) > 0).all()
    assert (bulge * arc[1:-1, 0] > 0).all()


def test_curve_is_selected_by_its_handle(tmp_path: Path) -> None:
    path = drawn(tmp_path)
    handle = ezdxf.readfile(path).modelspace()[1].dxf.handle
    found = moves(program_from_dxf(path, replace(ASKED, layer="", handle=handle.lower())))
    assert [round(1000 * pose[0, 3]) for _, pose in found] == [10, 10, 20, 20]


def test_drawings_unit_is_applied(tmp_path: Path) -> None:
    found = moves(program_from_dxf(drawn(tmp_path, unit=1), ASKED))
    assert found[2][1][0, 3] == pytest.approx(2.54)
    with pytest.raises(
        ShapeError, match=r"does not state its unit \(\$INSUNITS\); give it with --unit, in mm"
    ):
        program_from_dxf(drawn(tmp_path, unit=0), ASKED)
    found = moves(program_from_dxf(drawn(tmp_path, unit=0), replace(ASKED, unit_mm=2.0)))
    assert found[2][1][0, 3] == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        (replace(ASKED, layer="ct"), "has no curve on layer 'ct'; did you mean 'cut'?"),
        (
            replace(ASKED, layer=""),
            r"no curves selected. Name a layer or a handle; curves: cut \(1\), hole \(1\), seam \(3\)",
        ),
        (replace(ASKED, handle="FFFF"), "has no curve of handle 'FFFF' in its model space"),
        (
            replace(ASKED, layer="hole", tolerance_mm=1e-5),
            "more than a program can hold: use a larger tolerance",
        ),
    ],
)
def test_curves_that_cannot_be_followed_are_refused_with_a_reason(
    tmp_path: Path, asked: DxfPath, sentence: str
) -> None:
    with pytest.raises(ShapeError, match=sentence):
        program_from_dxf(drawn(tmp_path), asked)


def blocks(folder: Path, fill: Callable[[Drawing], object], unit: int = 4) -> Path:
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = unit
    fill(drawing)
    path = folder / "part.dxf"
    drawing.saveas(path)
    return path


def places(path: Path, **asked: str) -> list[list[float]]:
    """Return the points of each move [mm]."""
    text = program_from_dxf(path, DxfPath(approach_mm=0.0, **asked))
    return [(1000 * pose[:2, 3]).round(4).tolist() for _, pose in moves(text)[1:-1]]


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({}, [[1, 0], [3, 0], [3, 1]]),
        ({"xscale": -1}, [[-1, 0], [-3, 0], [-3, 1]]),
        ({"rotation": 90}, [[0, 1], [0, 3], [-1, 3]]),
        ({"xscale": 2, "yscale": -3}, [[2, 0], [6, 0], [6, -3]]),
        ({"xscale": 2, "yscale": 3, "rotation": 90}, [[0, 2], [0, 6], [-3, 6]]),
        ({"extrusion": (0, 0, -1)}, [[-1, 0], [-3, 0], [-3, 1]]),
    ],
)
def test_curves_of_a_block_are_placed_by_its_insert(
    tmp_path: Path, values: dict[str, object], expected: list[list[float]]
) -> None:
    def fill(drawing: Drawing) -> None:
        block = drawing.blocks.new("corner", base_point=(1, 1))
        block.add_lwpolyline([(2, 1), (4, 1), (4, 2)])
        drawing.modelspace().add_blockref("corner", (10, 20), {"layer": "cut", **values})

    x, y = (-10, 20) if "extrusion" in values else (10, 20)
    wanted = [[x + dx, y + dy] for dx, dy in expected]
    assert places(blocks(tmp_path, fill)) == wanted
    assert places(tmp_path / "part.dxf", layer="CUT") == wanted


def test_blocks_in_blocks_in_rows_and_columns_are_followed_within_the_tolerance(tmp_path: Path) -> None:
    def fill(drawing: Drawing) -> None:
        drawing.blocks.new("hole").add_circle((0, 0), 1)
        row = drawing.blocks.new("row")
        row.add_blockref("hole", (0, 0), {"rotation": 30, "column_count": 3, "column_spacing": 10})
        drawing.modelspace().add_blockref(
            "row", (0, 0), {"xscale": 4, "yscale": -2, "row_count": 2, "row_spacing": 50}
        )

    path = blocks(tmp_path, fill)
    asked = DxfPath(approach_mm=5.0, tolerance_mm=0.05)
    text = program_from_dxf(path, asked)
    assert text.startswith("# part.dxf, layer 0: 6 paths")
    points = np.array([1000 * pose[:3, 3] for _, pose in moves(text)])
    points = points[np.abs(points[:, 2]) < 1e-6][:, :2]
    step = np.array([4 * 10 * np.cos(np.pi / 6), -2 * 10 * np.sin(np.pi / 6)])
    centres = np.array([column * step + (0, 50 * row) for row in range(2) for column in range(3)])
    # Each point is on one of the ellipses of half-axes 4 and 2.
    away = np.abs(np.linalg.norm((points[:, None] - centres) / (4, 2), axis=2) - 1).min(axis=1)
    assert away.max() < 1e-6
    # The chords stay within the tolerance: an ellipse has at least this many.
    assert len(points) > 6 * 16


def test_one_layer_needs_no_name(tmp_path: Path) -> None:
    path = blocks(tmp_path, lambda drawing: drawing.modelspace().add_line((0, 0), (5, 0), {"layer": "a"}))
    text = program_from_dxf(path, DxfPath())
    assert text.startswith("# part.dxf, layer a: 1 path,")


def test_an_insert_is_selected_by_its_handle(tmp_path: Path) -> None:
    def fill(drawing: Drawing) -> None:
        drawing.blocks.new("line").add_line((0, 0), (5, 0))
        for y, layer in ((0, "a"), (7, "b")):
            drawing.modelspace().add_blockref("line", (0, y), {"layer": layer})

    path = blocks(tmp_path, fill)
    handle = ezdxf.readfile(path).modelspace()[1].dxf.handle
    assert places(path, handle=handle) == [[0, 7], [5, 7]]


def nested(drawing: Drawing, depth: int, copies: int) -> None:
    drawing.blocks.new("b0").add_line((0, 0), (1, 0))
    for number in range(1, depth):
        block = drawing.blocks.new(f"b{number}")
        for x in range(copies):
            block.add_blockref(f"b{number - 1}", (x, 0))
    drawing.modelspace().add_blockref(f"b{depth - 1}", (0, 0))


def cyclic(drawing: Drawing) -> None:
    nested(drawing, 2, 1)
    drawing.blocks.get("b0").add_blockref("b1", (0, 0))


def grid(drawing: Drawing) -> None:
    drawing.blocks.new("empty")
    values = {"row_count": 2**15, "column_count": 2**15, "row_spacing": 0, "column_spacing": 1}
    drawing.modelspace().add_blockref("empty", (0, 0), values)


@pytest.mark.parametrize(
    ("fill", "sentence"),
    [
        (lambda drawing: nested(drawing, 30, 10), "its blocks draw more than 20,000 curves and blocks"),
        (lambda drawing: nested(drawing, 200, 1), "block 'b199' is nested deeper than 32"),
        (grid, "its blocks draw more than 20,000 curves and blocks"),
        (cyclic, "block 'b1' contains itself: b1 > b0 > b1"),
        (lambda drawing: drawing.modelspace().add_blockref("none", (0, 0)), "curves: none"),
        (lambda drawing: drawing.modelspace().add_text("none"), "curves: none"),
    ],
)  # fmt: skip
def test_blocks_that_cannot_be_expanded_are_refused_at_once(
    tmp_path: Path, fill: Callable[[Drawing], object], sentence: str
) -> None:
    path = blocks(tmp_path, fill)
    with pytest.raises(ShapeError, match=sentence):
        program_from_dxf(path, DxfPath())


@pytest.mark.parametrize("content", [b"", b"solid a", b"0\nSECTION\n2\nENTITIES\n0\nLINE\n"])
def test_invalid_drawing_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "part.dxf"
    path.write_bytes(content)
    with pytest.raises(ShapeError) as caught:
        program_from_dxf(path, ASKED)
    assert "\n" not in str(caught.value)
