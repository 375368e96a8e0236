"""`robomesh program check|plan|from-dxf`: what they print, write and refuse."""

import io
import json
import sys
from pathlib import Path

import cv2
import ezdxf
import pytest

from services.command_line.main import run

SITE = """
site = "test"
[[robot]]
name = "one"
model = "pt600"
cell = "a"
controller = "simulated"
[[robot]]
name = "two"
model = "pt500"
cell = "a"
controller = "simulated"
pose = { xyz = [1500.0, 0.0, 0.0] }
[[fixture]]
cell = "a"
name = "post"
box = [60.0, 60.0, 1000.0]
pose = { xyz = [0.0, 450.0, 500.0] }
"""
GOOD = "speed 50\nmove_joints 20 80 -80 0 0\nhome\n"
INTO_THE_POST = "move_joints 90 45 -45 0 0\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "good").write_text(GOOD)
    (tmp_path / "bad").write_text(INTO_THE_POST)
    (tmp_path / "wrong").write_text("home\nspeed 0\n")
    (tmp_path / "site.toml").write_text(SITE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_valid_program_is_reported_as_text(folder: Path, capsys) -> None:
    assert run(["program", "check", "good", "--robot", "pt600"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0] == "note: only the floor around the arm: its cell has no fixture and no other robot"
    assert out[1].startswith("good: ")
    assert out[1].endswith(" s, nothing wrong")
    assert out[2].startswith("assumed of the controller: joint moves: straight between the joint positions")


def test_a_collision_in_a_sites_cell_prints_time_and_pair_with_status_1(folder: Path, capsys) -> None:
    assert run(["program", "check", "bad", "--robot", "one", "--site", "site.toml"]) == 1
    out = capsys.readouterr().out.splitlines()
    assert any(
        line.startswith("bad: line 1, ") and line.endswith("collision: one/forearm touches post")
        for line in out
    )
    assert "note: at home, for this check: two" in out


def test_json_is_one_object_with_the_contracts_keys(folder: Path, capsys) -> None:
    assert run(["program", "check", "bad", "--robot", "one", "--site", "site.toml", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert set(found) == {"ok", "duration_s", "violations", "interpolation", "notes", "alone"}
    assert found["ok"] is False
    touch = next(each for each in found["violations"] if each["kind"] == "collision")
    assert set(touch) >= {"line", "time_s", "kind", "pair", "points", "text"}
    assert (touch["line"], touch["distance_m"], len(touch["points"])) == (1, 0.0, 2)


def test_syntax_errors_are_listed_by_line_with_status_1(folder: Path, capsys) -> None:
    assert run(["program", "check", "wrong"]) == 1
    assert capsys.readouterr().out.splitlines() == [
        "wrong: line 2: 'speed' is 0; must be between 1 and 100 percent",
        "wrong: 1 error in the text",
    ]
    assert run(["program", "plan", "wrong"]) == 1
    assert capsys.readouterr().err == "wrong: line 2: 'speed' is 0; must be between 1 and 100 percent\n"


@pytest.mark.parametrize("text", ["", "# nothing yet\n", "speed 50\ntool_speed 100\n", "repeat 9\nend\n"])
def test_an_empty_program_is_an_error(folder: Path, capsys, text: str) -> None:
    (folder / "idle").write_text(text)
    assert run(["program", "check", "idle"]) == 1
    first, _ = capsys.readouterr().out.splitlines()
    assert first == "idle: line 1: the program has no statement that does anything"


def test_violations_with_one_cause_are_one_line_and_those_at_the_start_have_no_line_number(
    folder: Path, capsys
) -> None:
    (folder / "often").write_text(f"repeat 3\n{INTO_THE_POST}home\nend\n")
    given = ["program", "check", "often", "--robot", "one", "--site", "site.toml"]
    assert run([*given, "--start", "0 90 -90 0 400"]) == 1
    out = capsys.readouterr().out.splitlines()
    assert out[0].startswith("often: limit: at the start: joint roll ")
    (touch,) = [line for line in out if "collision: one/forearm touches post" in line]
    assert touch.startswith("often: lines 2 to 3, ")
    assert touch.endswith(" times)")
    assert run([*given, "--json"]) == 1
    touches = [
        each for each in json.loads(capsys.readouterr().out)["violations"] if "forearm" in each["text"]
    ]
    assert len(touches) >= 3


def test_the_start_option_is_in_degrees(folder: Path, capsys) -> None:
    (folder / "stay").write_text("move_joints 20 80 -80 0 0\n")
    assert run(["program", "check", "stay", "--start", "20, 80 -80 0 0", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["duration_s"] == 0.0


def test_a_plan_is_a_program_of_joint_moves_that_plans_to_itself(folder: Path, capsys, monkeypatch) -> None:
    (folder / "line").write_text(
        "move_joints 30 80 -80 -90 0\nmove_line 400 0 300 180 0 0\nwait 1\ntrace on\nhome\n"
    )
    assert run(["program", "plan", "line"]) == 0
    text = capsys.readouterr().out
    words = [line.split()[0] for line in text.splitlines()]
    assert words[:2] == ["speed", "move_joints"]
    assert words[-3:] == ["wait", "trace", "home"]
    assert len(words) > 6
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
    assert run(["program", "plan", "-"]) == 0
    assert capsys.readouterr().out == text
    assert run(["program", "plan", "line", "--json"]) == 0
    steps = json.loads(capsys.readouterr().out)["steps"]
    assert steps[0] == {"line": 1, "kind": "speed", "percent": 100.0}
    assert len(steps[1]["joints"]) == 5


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["check", "none"], "none: cannot be read: No such file or directory"),
        (["check", "."], ".: cannot be read: Is a directory"),
        (["check", "binary"], "binary: is not UTF-8 text: byte 0"),
        (["check", "large"], "large: has more than 65536 bytes, the most that a teach program may have"),
        (["check", "good", "--robot", "pt60"], "pt60: no such robot in the library; did you mean 'pt600'?"),
        (
            ["check", "good", "--robot", "three", "--site", "site.toml"],
            "--robot three: site.toml has no such robot; its robots: one, two",
        ),
        (
            ["check", "good", "--start", "1 2 x"],
            "--start '1 2 x': must be 5 numbers from -100000 to 100000 (waist shoulder elbow wrist roll)",
        ),
        (["check", "good", "--plot", "a.pdf"], "a.pdf: not saved, a picture's name must end in .png or .svg"),
        (
            ["from-dxf", "good", "--layer", "a", "--tolerance", "0"],
            "--tolerance 0: must be 0.001 to 100 mm",
        ),
    ],
)
def test_an_invalid_request_prints_one_line_with_status_2(
    folder: Path, capsys, arguments: list[str], sentence: str
) -> None:
    (folder / "binary").write_bytes(b"\xff\xfe\x00")
    (folder / "large").write_text("#" * 70_000)
    assert run(["program", *arguments]) == 2
    assert capsys.readouterr().err == f"robomesh: {sentence}\n"


@pytest.mark.slow
def test_a_plot_is_png_or_svg(folder: Path, capsys) -> None:
    for name in ("bad", "wrong"):
        assert (
            run(["program", "check", name, "--robot", "one", "--site", "site.toml", "--plot", "a.png"]) == 1
        )
        assert cv2.imread("a.png").shape[1] == 1200
    assert run(["program", "check", "good", "--plot", "a.svg"]) == 0
    drawn = (folder / "a.svg").read_text()
    assert drawn.startswith("<?xml")
    assert "<!-- good on pt600: " in drawn


def test_a_drawing_becomes_a_valid_program(folder: Path, capsys) -> None:
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = 4
    drawing.modelspace().add_lwpolyline([(0, 0), (60, 0), (60, 60)], dxfattribs={"layer": "cut"})
    drawing.saveas(folder / "part.dxf")
    given = ["from-dxf", "part.dxf", "--layer", "cut", "--frame", "380 -30 250 0 0 0", "--out", "part"]
    assert run(["program", *given]) == 0
    assert capsys.readouterr().out == "part\n"
    assert run(["program", *given]) == 2
    assert capsys.readouterr().err == "robomesh: part: exists already; --force overwrites it\n"
    assert run(["program", *given, "--force"]) == 0
    assert run(["program", "check", "part", "--start", "0 80 -80 -90 0"]) == 0
