"""`robomesh shapes info` and `shapes convert`."""

import json
from pathlib import Path

import numpy as np
import pytest

from robots.shapes.files.read import read_geometry
from robots.shapes.geometry import bounds
from services.command_line.main import run

BOX = """#VRML V2.0 utf8
Shape { appearance Appearance { material DEF glass Material { diffuseColor 0.2 0.4 0.6 transparency 0.5 } }
  geometry Box { size 100 200 300 } }
"""


@pytest.fixture
def box(tmp_path: Path) -> Path:
    path = tmp_path / "box.wrl"
    path.write_text(BOX)
    return path


@pytest.mark.parametrize("ending", [".stl", ".obj", ".ply", ".wrl", ".3ds"])
def test_conversion_keeps_shape_units_and_axes(
    box: Path, ending: str, capsys: pytest.CaptureFixture[str]
) -> None:
    target = box.with_name(f"out{ending}")
    assert run(["shapes", "convert", str(box), str(target)]) == 0
    assert capsys.readouterr().out == f"{target}: 12 triangles\n"
    geometry = read_geometry(target)
    assert geometry.triangle_count == 12
    np.testing.assert_allclose(bounds(geometry), [[-50, -100, -150], [50, 100, 150]])


@pytest.mark.parametrize("ending", [".obj", ".ply", ".wrl", ".3ds"])
def test_conversion_keeps_colour_and_transparency(box: Path, ending: str) -> None:
    target = box.with_name(f"out{ending}")
    assert run(["shapes", "convert", str(box), str(target)]) == 0
    (part,) = read_geometry(target).parts
    assert part.material.diffuse == pytest.approx((0.2, 0.4, 0.6), abs=0.005)
    assert part.material.transparency == pytest.approx(0.5, abs=0.005)


def test_glb_is_in_metres_and_the_guessed_unit_is_printed(
    box: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = box.with_name("out.glb")
    assert run(["shapes", "convert", str(box), str(target)]) == 0
    assert "millimetres assumed" in capsys.readouterr().err
    np.testing.assert_allclose(bounds(read_geometry(target)), [[-0.05, -0.1, -0.15], [0.05, 0.1, 0.15]])


def test_scale_and_up_options_are_applied(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = box.with_name("out.glb")
    assert run(["shapes", "convert", str(box), str(target), "--scale", "0.01", "--up", "y"]) == 0
    assert capsys.readouterr().err == ""
    np.testing.assert_allclose(bounds(read_geometry(target)), [[-0.5, -1.5, -1.0], [0.5, 1.5, 1.0]])


def test_lost_properties_are_printed(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["shapes", "convert", str(box), str(box.with_name("out.stl"))]) == 0
    assert (
        "out.stl: STL holds shape only: colours, transparency and names are lost" in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["out.dxf"], "ending '.dxf' is unknown; must be one of .glb, .stl, .obj, .ply, .wrl, .3ds"),
        (["out.stl", "--up", "x"], "--up x: must be y or z"),
        (["out.stl", "--scale", "-1"], "--scale -1.0: must be a number above 0"),
        (["box.wrl"], "box.wrl: is the input file; name another output"),
        (["none/out.stl"], "cannot be written: No such file or directory"),
    ],
)
def test_error_of_an_impossible_conversion_is_one_line(
    box: Path, arguments: list[str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    target = str(box.parent / arguments[0])
    assert run(["shapes", "convert", str(box), target, *arguments[1:]]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith("robomesh: ")
    assert expected in error


def test_empty_shape_is_not_written(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    nothing = box.with_name("nothing.wrl")
    nothing.write_text("#VRML V2.0 utf8\n")
    assert run(["shapes", "convert", str(nothing), str(box.with_name("out.glb"))]) == 2
    assert "holds no geometry" in capsys.readouterr().err
    assert not box.with_name("out.glb").exists()


def test_failed_conversion_leaves_the_old_file_and_nothing_else(box: Path) -> None:
    target = box.with_name("out.stl")
    target.write_text("precious")
    broken = box.with_name("broken.3ds")
    broken.write_bytes(b"MM\0\0")
    assert run(["shapes", "convert", str(broken), str(target)]) == 2
    assert target.read_text() == "precious"
    assert sorted(path.name for path in box.parent.iterdir()) == ["box.wrl", "broken.3ds", "out.stl"]


@pytest.mark.slow
def test_shape_too_large_for_3ds_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    heights = " ".join("0" for _ in range(300 * 300))
    path = tmp_path / "grid.wrl"
    path.write_text(
        "#VRML V2.0 utf8\nShape { geometry ElevationGrid { xDimension 300 zDimension 300"
        f" height [ {heights} ] }} }}"
    )
    assert run(["shapes", "convert", str(path), str(tmp_path / "out.3ds")]) == 2
    assert "more than 65535 vertices or triangles" in capsys.readouterr().err
    assert not (tmp_path / "out.3ds").exists()


def test_info_prints_the_documented_json(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["shapes", "info", str(box), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "triangles": 12,
        "min": [-50.0, -100.0, -150.0],
        "max": [50.0, 100.0, 150.0],
        "materials": ["glass"],
        "colors": ["#33669980"],
        "warnings": [],
    }


def test_info_prints_the_assumed_unit(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["mesh", "info", str(box)]) == 0  # the earlier name of `shapes`
    assert (
        "millimetres assumed, the file states no unit: 300 mm large; z up assumed" in capsys.readouterr().out
    )
