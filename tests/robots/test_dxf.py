"""DXF, from drawings made here with ezdxf."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robots.schema.errors import ShapeError
from robots.shapes.files import dxf
from robots.shapes.files.dxf import read_dxf
from robots.shapes.geometry import Geometry, bounds

ezdxf: Any = dxf._ezdxf()
SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]


@pytest.fixture
def drawing() -> Any:
    return ezdxf.new("R2010", units=4)


def read(folder: Path, drawing: Any, kind: str = "asc") -> Geometry:
    path = folder / "drawing.dxf"
    drawing.saveas(path, fmt=kind)
    return read_dxf(path)


@pytest.mark.parametrize("kind", ["asc", "bin"])
def test_quadrilateral_face_becomes_two_triangles(tmp_path: Path, drawing: Any, kind: str) -> None:
    drawing.modelspace().add_3dface(SQUARE)
    drawing.modelspace().add_3dface([(0, 0, 5), (1, 0, 5), (0, 1, 5), (0, 1, 5)])
    geometry = read(tmp_path, drawing, kind)
    assert geometry.triangle_count == 3
    np.testing.assert_array_equal(bounds(geometry), [[0, 0, 0], [1, 1, 5]])
    assert (geometry.unit_m, geometry.up, geometry.warnings) == (0.001, "z", ())


def test_block_within_a_block_is_scaled_mirrored_turned_and_repeated(tmp_path: Path, drawing: Any) -> None:
    inner = drawing.blocks.new("inner")
    inner.add_3dface([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    outer = drawing.blocks.new("outer")
    # Mirrored in x and doubled, then a quarter turn: (1, 0) goes to (0, -2), (0, 1) to (-2, 0).
    outer.add_blockref(
        "inner", (10, 0, 0), dxfattribs={"xscale": -2, "yscale": 2, "zscale": 2, "rotation": 90}
    )
    drawing.modelspace().add_blockref(
        "outer",
        (0, 0, 5),
        dxfattribs={"column_count": 3, "row_count": 2, "column_spacing": 100, "row_spacing": 50},
    )
    geometry = read(tmp_path, drawing)
    assert geometry.triangle_count == 6
    np.testing.assert_allclose(bounds(geometry), [[8, -2, 5], [210, 50, 5]], atol=1e-9)


def test_polyface_polygon_mesh_and_mesh_are_triangles(tmp_path: Path, drawing: Any) -> None:
    space = drawing.modelspace()
    polyface = space.add_polyface()
    polyface.append_faces([SQUARE, [(0, 0, 1), (1, 0, 1), (1, 1, 1)]])
    grid = space.add_polymesh((3, 4))
    for row in range(3):
        for column in range(4):
            grid.set_mesh_vertex((row, column), (row, column, 9))
    # An arrow head, hollow at one corner: no fan from its first corner covers it.
    arrow = space.add_mesh()
    with arrow.edit_data() as data:
        data.vertices = [(2, 0, 0), (-2, 3, 0), (-1, 0, 0), (-2, -3, 0)]
        data.faces = [(1, 2, 3, 0)]
    geometry = read(tmp_path, drawing)
    assert geometry.triangle_count == (2 + 1) + 2 * 3 * 2 + 2
    (part,) = geometry.parts
    flat = part.vertices[part.triangles]
    arrow_area = sum(
        abs(np.cross(b - a, c - a)[2]) / 2
        for a, b, c in flat
        if a[2] == b[2] == c[2] == 0 and abs(np.array([a, b, c])).max() > 1
    )
    assert arrow_area == pytest.approx(9.0)  # 12 for the whole, 3 for the hollow


def test_colours_are_the_entitys_its_layers_or_its_inserts(tmp_path: Path, drawing: Any) -> None:
    drawing.layers.add("steel", color=1)
    block = drawing.blocks.new("block")
    block.add_3dface(SQUARE, dxfattribs={"color": 0})
    space = drawing.modelspace()
    space.add_3dface(SQUARE, dxfattribs={"layer": "steel"})
    space.add_3dface(SQUARE, dxfattribs={"true_color": 0x336699})
    space.add_3dface(SQUARE, dxfattribs={"color": 5, "layer": "steel"})
    space.add_blockref("block", (0, 0), dxfattribs={"color": 3})
    found = {part.material.diffuse for part in read(tmp_path, drawing).parts}
    assert found == {(1.0, 0.0, 0.0), (0.2, 0.4, 0.6), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)}


def test_curves_and_points_are_wires_and_no_triangles(tmp_path: Path, drawing: Any) -> None:
    space = drawing.modelspace()
    space.add_line((0, 0, 0), (1, 2, 3))
    space.add_lwpolyline([(0, 0), (1, 0), (1, 1)], close=True)
    space.add_circle((0, 0), 5)
    space.add_point((7, 8, 9))
    geometry = read(tmp_path, drawing)
    assert geometry.triangle_count == 0
    lines, points = geometry.wires
    assert lines.segments[:4].tolist() == [[0, 1], [2, 3], [3, 4], [4, 5]]
    assert np.linalg.norm(lines.vertices[6:], axis=1) == pytest.approx(5.0, rel=1e-3)
    assert points.vertices.tolist() == [[7, 8, 9]]
    assert len(points.segments) == 0


def test_curve_without_finite_points_is_rejected(tmp_path: Path, drawing: Any) -> None:
    drawing.modelspace().add_circle((float("nan"), 0), 5)
    with pytest.raises(ShapeError, match="CIRCLE on layer '0' has a point with a non-finite coordinate"):
        read(tmp_path, drawing)


def test_acis_solids_are_omitted_with_a_recommendation(tmp_path: Path, drawing: Any) -> None:
    drawing.modelspace().add_3dface(SQUARE)
    drawing.modelspace().add_3dsolid().sat = ["400 0 1 0", "End-of-ACIS-data"]
    drawing.modelspace().add_text("a note")
    assert read(tmp_path, drawing).warnings == (
        "1 3DSOLID left out: ACIS shapes are not read; export STEP or STL",
        "left out: 1 TEXT",
    )


@pytest.mark.parametrize(("units", "unit_m"), [(0, None), (1, 0.0254), (4, 0.001), (6, 1.0)])
def test_unit_is_read_from_the_drawing(tmp_path: Path, units: int, unit_m: float | None) -> None:
    drawing = ezdxf.new("R2010", units=units)
    drawing.modelspace().add_3dface(SQUARE)
    assert read(tmp_path, drawing).unit_m == unit_m


@pytest.mark.slow
def test_nested_blocks_with_millions_of_copies_are_rejected(
    tmp_path: Path, drawing: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dxf, "MAX_COPIES", 2000)
    drawing.blocks.new("b0").add_3dface(SQUARE)
    for level in range(1, 8):
        block = drawing.blocks.new(f"b{level}")
        for _ in range(20):
            block.add_blockref(f"b{level - 1}", (0, 0))
    drawing.modelspace().add_blockref("b7", (0, 0))
    with pytest.raises(ShapeError, match="2001 copies of blocks; at most 2000 are read"):
        read(tmp_path, drawing)


@pytest.mark.parametrize("row_spacing", [0, 1])
def test_huge_array_is_refused(tmp_path: Path, drawing: Any, row_spacing: int) -> None:
    drawing.blocks.new("b").add_3dface(SQUARE)
    spread = {"column_count": 30000, "row_count": 30000, "column_spacing": 1, "row_spacing": row_spacing}
    drawing.modelspace().add_blockref("b", (0, 0), dxfattribs=spread)
    with pytest.raises(ShapeError, match="INSERT 'b': 900000000 copies"):
        read(tmp_path, drawing)


@pytest.mark.parametrize("kind", ["mesh", "polyline"])
def test_copies_of_a_large_entity_are_refused(
    tmp_path: Path, drawing: Any, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    monkeypatch.setattr(dxf, "MAX_COPIED_POINTS", 900)
    outline = [(x, x % 7, 0) for x in range(100)]
    block = drawing.blocks.new("b")
    if kind == "mesh":
        with block.add_mesh().edit_data() as data:
            data.vertices, data.faces = outline, [range(100)]
    else:
        block.add_lwpolyline(outline)
    drawing.modelspace().add_blockref("b", (0, 0), dxfattribs={"column_count": 4, "column_spacing": 1})
    assert not read(tmp_path, drawing).warnings
    drawing.modelspace().add_blockref("b", (0, 0), dxfattribs={"column_count": 6, "column_spacing": 1})
    with pytest.raises(ShapeError, match="copies of blocks have more than 900 points"):
        read(tmp_path, drawing)


def test_entities_that_are_not_drawn_are_not_copied_with_their_block(
    tmp_path: Path, drawing: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    copied: list[object] = []
    monkeypatch.setattr(ezdxf.entities.Hatch, "copy_data", lambda *arguments: copied.append(arguments))
    block = drawing.blocks.new("b")
    block.add_line((0, 0), (1, 1))
    block.add_hatch().paths.add_polyline_path(SQUARE)
    for place in range(2):
        drawing.modelspace().add_blockref("b", (place, 0), dxfattribs={"row_count": 3, "row_spacing": 1})
    geometry = read(tmp_path, drawing)
    assert not copied
    assert geometry.warnings == ("left out: 6 HATCH",)
    assert geometry.wires


def test_truncated_file_is_repaired_or_rejected(tmp_path: Path, drawing: Any) -> None:
    for _ in range(5):
        drawing.modelspace().add_3dface(SQUARE)
    path = tmp_path / "drawing.dxf"
    drawing.saveas(path)
    whole = path.read_bytes()
    for end in range(0, len(whole), len(whole) // 12):
        path.write_bytes(whole[:end])
        try:
            warnings: tuple[str, ...] = read_dxf(path).warnings
        except ShapeError as error:
            warnings = (str(error),)
        assert "damaged" in warnings[0] or "drawing.dxf: " in warnings[0]
        assert "\n" not in warnings[0]


@pytest.mark.parametrize("content", [b"hello\n", b"  0\nSECTION\n", b"AutoCAD Binary DXF\r\n\x1a\x00xx"])
def test_invalid_file_is_rejected_with_a_reason(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "wrong.dxf"
    path.write_bytes(content)
    with pytest.raises(ShapeError, match=r"wrong\.dxf: cannot be read as DXF"):
        read_dxf(path)


@pytest.mark.slow
def test_nothing_is_written_to_the_users_home(tmp_path: Path, drawing: Any) -> None:
    drawing.modelspace().add_circle((0, 0), 5)
    path = tmp_path / "drawing.dxf"
    drawing.saveas(path)
    home = tmp_path / "home"
    home.mkdir()
    code = (
        "from pathlib import Path; from robots.shapes.files.dxf import read_dxf; "
        f"read_dxf(Path({str(path)!r}))"
    )
    subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        check=True,
        env={"HOME": str(home), "PYTHONPATH": ":".join(sys.path), "PATH": os.environ["PATH"]},
    )
    assert list(home.iterdir()) == []
