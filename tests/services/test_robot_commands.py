"""`robomesh robot check|show|import|export`: what they print, write and refuse."""

import io
import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from robots.descriptions.description import LIBRARY, load
from robots.kinematics.model import build_model, link_placements, tool_placement
from robots.schema.robot_toml import DhDescription, UrdfDescription
from services.command_line.main import run
from tests.renderer.bodies import context_or_skip

LIMIT = '<limit lower="-1" upper="2" velocity="3" effort="1"/>'
STL = b"""solid a
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
endsolid a
"""
ARM = f"""<robot name="two">
<link name="root">
  <visual><geometry><mesh filename="package://two/one.stl" scale="0.5 0.5 0.5"/></geometry></visual>
</link>
<link name="arm"><visual><geometry><box size="0.1 0.2 0.3"/></geometry></visual></link>
<link name="hand"><visual><geometry><mesh filename="package://two/none.stl"/></geometry></visual></link>
<joint name="turn" type="revolute"><origin xyz="0 0 0.4"/><axis xyz="0 0 1"/>
  <parent link="root"/><child link="arm"/>{LIMIT}</joint>
<joint name="lift" type="prismatic"><origin xyz="0.3 0 0" rpy="0.3 0 0"/><axis xyz="0 1 0"/>
  <parent link="arm"/><child link="hand"/>{LIMIT}</joint>
</robot>"""
VRML = """#VRML V2.0 utf8
DEF V Humanoid { name "vee" humanoidBody [ DEF ROOT Joint { jointType "fixed" children [
  DEF BASE Segment { children Shape { geometry Box { size 0.1 0.1 0.1 } } }
  DEF J1 Joint { jointType "rotate" jointId 0 jointAxis 0 1 0 translation 0 0 0.5
    llimit -1 ulimit 1 children [
    DEF L1 Segment { children Shape { geometry Box { size 0.2 0.2 0.2 } } } ] } ] } ] }
"""  # fmt: skip


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    package = tmp_path / "packages" / "two"
    package.mkdir(parents=True)
    (package / "one.stl").write_bytes(STL)
    (tmp_path / "two.urdf").write_text(ARM)
    return tmp_path / "two.urdf"


def placements(source: Path, positions: list[float]) -> tuple[dict[str, np.ndarray], np.ndarray]:
    model = build_model(load(source))
    links = dict(zip(model.link_names, link_placements(model, positions), strict=True))
    return links, tool_placement(model, positions)


@pytest.mark.parametrize("dh", [False, True])
def test_an_imported_urdf_is_a_self_contained_folder(
    dh: bool, arm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = placements(arm, [0.5, 0.1])
    out = tmp_path / "out" / "My Arm"
    options = ["--dh"] if dh else []
    assert (
        run(["robot", "import", str(arm), str(out), "--package", str(tmp_path / "packages"), *options]) == 1
    )
    printed = capsys.readouterr()
    assert printed.out.strip() == str(out / "robot.toml")
    assert "missing: package://two/none.stl: that shape is left out" in printed.err
    (tmp_path / "packages" / "two" / "one.stl").unlink()
    arm.unlink()
    description = load(out)
    assert isinstance(description, DhDescription if dh else UrdfDescription)
    links, tool = placements(out, [0.5, 0.1])
    np.testing.assert_allclose(tool, before[1], atol=1e-12)
    if not dh:
        for name, placement in before[0].items():
            np.testing.assert_allclose(links[name], placement, atol=1e-12)
    glbs = {path.name for path in (out / "meshes").iterdir()}
    assert glbs == ({"base.glb", "arm.glb"} if dh else {"root.glb", "arm.glb"})
    assert run(["robot", "check", str(out)]) == 0


def test_an_imported_vrml_robot_keeps_its_placement(tmp_path: Path) -> None:
    (tmp_path / "v.wrl").write_text(VRML)
    before = placements(tmp_path / "v.wrl", [0.3])
    assert run(["robot", "import", str(tmp_path / "v.wrl"), str(tmp_path / "vee")]) == 0
    after = placements(tmp_path / "vee", [0.3])
    assert list(after[0]) == list(before[0]) == ["BASE", "L1"]
    np.testing.assert_allclose(after[0]["L1"], before[0]["L1"], atol=1e-12)
    np.testing.assert_allclose(after[0]["L1"][:3, 3], [0, 0, 0.5], atol=1e-12)


def test_an_imported_library_robot_includes_its_shapes(tmp_path: Path) -> None:
    assert run(["robot", "import", "pt500", str(tmp_path / "mine")]) == 0
    assert load(tmp_path / "mine").model_dump() == load("pt500").model_dump()


def test_import_does_not_overwrite_a_folder(
    arm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "thesis.txt").write_text("mine")
    assert run(["robot", "import", str(arm), str(out)]) == 2
    assert "exists and is not a robot's folder" in capsys.readouterr().err
    assert [path.name for path in out.iterdir()] == ["thesis.txt"]


def test_import_of_an_invalid_file_writes_nothing(
    arm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "packages" / "two" / "one.stl").write_bytes(b"solid a\nfacet normal x y z\n")
    out = tmp_path / "out"
    assert run(["robot", "import", str(arm), str(out), "--package", str(tmp_path / "packages")]) == 2
    assert "one.stl" in capsys.readouterr().err
    assert not out.exists()


def test_check_of_a_missing_file_ends_with_status_2(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["robot", "check", "nobody"]) == 2
    assert run(["robot", "check", "none/robot.toml"]) == 2
    assert "none/robot.toml: cannot be read" in capsys.readouterr().err


def test_export_does_not_overwrite_another_robots_shapes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["robot", "export", "pt600", str(tmp_path / "out")]) == 0
    mesh = (tmp_path / "out" / "meshes" / "base.glb").read_bytes()
    assert run(["robot", "export", "pt500", str(tmp_path / "out")]) == 2
    assert "holds another robot (pt600.urdf)" in capsys.readouterr().err
    assert (tmp_path / "out" / "meshes" / "base.glb").read_bytes() == mesh
    assert run(["robot", "export", "pt600", str(tmp_path / "out")]) == 0


def test_check_reads_every_shape_and_prints_file_and_problem(
    arm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = tmp_path / "robot.toml"
    robot.write_text('name = "two"\nurdf = "two.urdf"\npackages = ["packages"]\n')
    assert run(["robot", "check", str(robot), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["ok"] is False
    assert found["problems"] == [
        {
            "file": str(robot),
            "path": [],
            "text": "mesh 'package://two/none.stl': no such file; did you mean 'packages/two/one.stl'?",
        }
    ]
    (tmp_path / "packages" / "two" / "none.stl").write_bytes(b"solid a\nendsolid a\n")
    assert run(["robot", "check", str(robot)]) == 1
    assert "none.stl: " in capsys.readouterr().out
    (tmp_path / "packages" / "two" / "none.stl").write_bytes(STL.replace(b"vertex 1", b"vertex 500"))
    assert run(["robot", "check", str(robot)]) == 0
    assert "link 'hand': is 500 m large at 1 m per unit; check mesh_scale" in capsys.readouterr().out


def test_check_prints_the_path_of_an_invalid_value(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = tmp_path / "robot.toml"
    robot.write_text(load("pt600").text.replace("limits = [-150.0, 150.0]", "limits = [150.0, -150.0]"))
    assert run(["robot", "check", str(robot), "--json"]) == 1
    problems = json.loads(capsys.readouterr().out)["problems"]
    assert problems[0] == {
        "file": str(robot),
        "path": ["joint", 0, "limits"],
        "text": "joint 'waist' limits = [150, -150]: the lower must be below the upper",
    }
    # The meshes are next to another file.
    assert ["base", "mesh"] in [problem["path"] for problem in problems]


def test_show_marks_the_variable_of_each_row(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["robot", "show", "pt600"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["waist", "0.000", "90.000", "350.000", "0.000*", "column"] in lines
    assert ["wrist", "0.000", "90.000", "0.000", "90.000*", "wrist"] in lines
    assert ["tool", "at", "home:", "420.0", "0.0", "650.0", "mm"] in lines
    assert not [line for line in lines if line[:3] == ["the", "first", "row"]]


def test_show_gives_the_rows_of_a_urdf_in_si(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["robot", "show", str(arm), "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    turn, lift = shown["dh"]["rows"]
    # The slide is tilted by 0.3 from the first joint's y, 0.3 m along x.
    assert (turn["a"], turn["d"], abs(turn["alpha"])) == pytest.approx((0.3, 0.4, np.pi / 2 - 0.3))
    assert lift["type"] == "prismatic"
    assert [frame["link"] for frame in shown["frames"]] == ["hand"]


def test_show_prints_the_start_of_the_rows_if_not_the_base_frame(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = tmp_path / "puma" / "robot.toml"
    shutil.copytree(LIBRARY / "puma560", robot.parent)
    text = robot.read_text()
    assert "[base]\n" in text
    pose = "pose = { xyz = [0, 0, 400], rpy = [180, 0, 0] }"
    robot.write_text(text.replace("[base]\n", f"[base]\n{pose}\n"))
    assert run(["robot", "show", str(robot)]) == 0
    expected = "the first row begins at xyz [0, 0, 400] mm, rpy [180, 0, 0]° in the base frame"
    assert expected in capsys.readouterr().out


@pytest.mark.slow
def test_four_views_are_one_picture(tmp_path: Path) -> None:
    context_or_skip().release()
    assert run(["robot", "show", "pt600", "--png", str(tmp_path / "four.png")]) == 0
    picture = cv2.imread(str(tmp_path / "four.png"))
    assert picture is not None
    assert picture.shape == (1080, 1440, 3)
    blue, _, red = (picture[..., channel].astype(int) for channel in range(3))
    orange = red - blue > 60
    for rows in (slice(0, 540), slice(540, 1080)):
        for columns in (slice(0, 720), slice(720, 1440)):
            # The arm is orange, and fills some of each quarter.
            assert 0.003 < orange[rows, columns].mean() < 0.5


def test_an_exported_urdf_names_existing_shapes(arm: Path, tmp_path: Path) -> None:
    robot = tmp_path / "robot.toml"
    robot.write_text('name = "two"\nurdf = "two.urdf"\npackages = ["packages"]\n')
    assert run(["robot", "export", str(robot), str(tmp_path / "export")]) == 0
    again = load(tmp_path / "export" / "two.urdf")
    assert isinstance(again, UrdfDescription)
    assert again.robot.missing == ()
    np.testing.assert_allclose(
        placements(tmp_path / "export" / "two.urdf", [1.0, 0.2])[1],
        placements(robot, [1.0, 0.2])[1],
        atol=1e-12,
    )


@pytest.mark.parametrize(
    "line",
    [b'{"joints": \xff}', b'{"joints": [1' + 400 * b"0" + b", 0, 0, 0, 0]}", b'{"joints": ' + 100_000 * b"["],
)
def test_an_invalid_fk_line_gets_an_error_and_the_next_an_answer(line, capsys, monkeypatch):
    lines = line + b'\n{"joints": [0, 0, 0, 0, 0]}\n'
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(lines)))
    assert run(["fk", "-"]) == 1
    wrong, right = map(json.loads, capsys.readouterr().out.splitlines())
    assert "is no request" in wrong["error"]
    assert len(right["tool"]) == 4
