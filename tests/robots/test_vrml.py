"""The VRML 2.0 reader as a whole: the paper's sample, real files, large ones, hostile ones."""

import json
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from robots.schema.errors import ShapeError
from robots.shapes.files.read import read_geometry
from robots.shapes.files.vrml.read import read_vrml
from robots.shapes.geometry import Geometry, bounds

FILES = Path(__file__).with_name("files")

Draw = Callable[[str], Geometry]

# Printed with errors: a blank in the header, a name that begins with a digit, a sign apart from its digits.
PAPER_SAMPLE = """# VRML V2.0 utf8
Shape {
  appearance Appearance { material Material { diffuseColor 0.7 0.7 0.7  transparency 0 } }
  geometry DEF 1-FACES IndexedFaceSet {
    ccw TRUE
    solid TRUE
    coord DEF 1-COORD Coordinate { point [
      0 30.8 0, - 25.08 -6.161 13.86, 25.08 -6.161 13.86, 25.08 -6.161 -13.86,
      -25.08 -6.161 -13.86, 0 -6.161 0 ] }
    coordIndex [ 0, 1, 2, -1, 0, 2, 3, -1, 0, 3, 4, -1, 0, 4, 1, -1,
                 1, 5, 2, -1, 2, 5, 3, -1, 3, 5, 4, -1, 4, 5, 1, -1 ]
  }
}
"""


def test_papers_sample_is_read_with_warnings(tmp_path: Path) -> None:
    path = tmp_path / "a.wrl"
    path.write_text(PAPER_SAMPLE)
    geometry = read_vrml(path)
    low, high = bounds(geometry)
    assert geometry.triangle_count == 8
    assert low.tolist() == [-25.08, -6.161, -13.86]
    assert high.tolist() == [25.08, 30.8, 13.86]
    assert geometry.parts[0].material.diffuse == (0.7, 0.7, 0.7)
    assert geometry.warnings == (
        "line 1, column 1: the header has a blank, '# VRML'; it should be '#VRML V2.0 utf8'",
        "line 4, column 16: the name '1-FACES' begins with a digit; accepted",
        "line 8, column 17: a sign is separated from its digits by a blank; read as one number",
    )


@pytest.mark.parametrize(
    "expected", json.loads((FILES / "expected.json").read_text("utf-8")), ids=lambda row: str(row["file"])
)
def test_real_file_has_the_triangles_and_bounds_that_other_readers_agree_on(
    expected: dict[str, object],
) -> None:
    geometry = read_geometry(FILES / str(expected["file"]))
    low, high = bounds(geometry)
    assert geometry.triangle_count == expected["triangles"]
    np.testing.assert_allclose(low, expected["min"], atol=1e-5)
    np.testing.assert_allclose(high, expected["max"], atol=1e-5)
    # Some of the 3DS files have textures, which cause warnings.
    assert geometry.warnings == () or str(expected["file"]).startswith("3ds/")


def test_truncated_file_is_an_error_or_a_smaller_shape(tmp_path: Path) -> None:
    path = tmp_path / "a.wrl"
    for end in range(20, len(PAPER_SAMPLE), 7):
        path.write_text(PAPER_SAMPLE[:end])
        with suppress(ShapeError):
            assert read_vrml(path).triangle_count <= 8


def grid(count: int) -> str:
    """Return a surface of 2 (count - 1)^2 triangles."""
    lines, columns = np.mgrid[:count, :count]
    points = np.column_stack([columns.ravel(), lines.ravel(), np.sin(columns.ravel())])
    first = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    lower, upper = np.array([[0], [1], [count + 1]]), np.array([[0], [count + 1], [count]])
    faces = np.concatenate([first + lower, first + upper], axis=1).T
    return (
        "Shape { geometry IndexedFaceSet { coord Coordinate { point [\n"
        + "\n".join(f"{x} {y} {z:.5f}," for x, y, z in points.tolist())
        + "\n] } coordIndex [\n"
        + "\n".join(f"{a}, {b}, {c}, -1," for a, b, c in faces.tolist())
        + "\n] } }"
    )


def test_progress_rises_to_one(tmp_path: Path) -> None:
    path = tmp_path / "a.wrl"
    path.write_text(f"#VRML V2.0 utf8\n{grid(300)}")
    progress: list[float] = []
    assert read_vrml(path, progress.append).triangle_count == 2 * 299**2
    assert len(progress) > 4
    assert progress == sorted(progress)
    assert progress[-1] == 1.0
    assert 0.0 <= progress[0] <= 0.7


def test_list_read_in_pieces_keeps_every_number(draw: Draw) -> None:
    # Over a megabyte: more than one piece, numbers across the seam.
    numbers = np.arange(300_000)
    points = ", ".join(f"{n}.25 -{n} 0" for n in numbers.tolist())
    (wire,) = draw(f"Shape {{ geometry PointSet {{ coord Coordinate {{ point [ {points} ] }} }} }}").wires
    np.testing.assert_array_equal(wire.vertices[:, 0], numbers + 0.25)
    np.testing.assert_array_equal(wire.vertices[:, 1], -numbers)


# Made to take all memory, or for ever


def refused_in_time(draw: Draw, text: str, reason: str) -> None:
    begin = time.monotonic()
    with pytest.raises(ShapeError, match=reason):
        draw(text)
    assert time.monotonic() - begin < 20


def test_uses_of_uses_cannot_exhaust_the_reader(draw: Draw) -> None:
    groups = [f"DEF G{n + 1} Group {{ children [ USE G{n} USE G{n} ] }}" for n in range(60)]
    refused_in_time(draw, "\n".join(["DEF G0 Shape { }", *groups]), "draws more than 200000 nodes")


@pytest.mark.slow
def test_uses_in_a_proto_cannot_exhaust_the_reader(draw: Draw) -> None:
    groups = [f"DEF G{n + 1} Group {{ children [ USE G{n} USE G{n} ] }}" for n in range(60)]
    body = "\n".join(["Group { children [ DEF G0 Transform { translation IS at }", *groups, "] }"])
    refused_in_time(
        draw, f"PROTO P [ field SFVec3f at 0 0 0 ] {{ {body} }} P {{ }}", "draws more than 200000 nodes"
    )


def test_uses_of_a_large_shape_are_counted(draw: Draw, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robots.shapes.files.vrml.drawing.MAX_TRIANGLES", 100_000)
    uses = "DEF S " + grid(120) + "USE S " * 4
    refused_in_time(draw, f"Group {{ children [ {uses} ] }}", "draws more than 100000 triangles")


def test_extrusion_of_millions_of_points_is_refused(draw: Draw) -> None:
    spine, section = "0 1 2 " * 4000, "1 2 " * 4000
    refused_in_time(
        draw,
        f"Shape {{ geometry Extrusion {{ spine [ {spine} ] crossSection [ {section} ] }} }}",
        "4000 x 4000 points; at most 5000000",
    )


def test_grid_without_enough_heights_is_rejected(draw: Draw) -> None:
    refused_in_time(
        draw,
        "Shape { geometry ElevationGrid { xDimension 4000000000 zDimension 4000000000 height [ 0 0 ] } }",
        "height has 2 numbers; 4000000000 x 4000000000 are needed",
    )


@pytest.mark.parametrize(
    "text",
    [
        "Group { children " * 5000,
        "PROTO A [ ] { " * 5000,
        "[" * 5000,
        "Group { children [ " * 5000,
        'WorldInfo { title "' + " " * 100_000,
        "#" * 100_000 + "\n" + " , " * 100_000 + '"',
    ],
)
def test_unclosed_or_deeply_nested_text_is_rejected(draw: Draw, text: str) -> None:
    refused_in_time(draw, text, r"nested deeper than 120|was expected|does not end")
