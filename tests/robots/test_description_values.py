"""Descriptions from plain values: all problems together, each with the path of its value."""

from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.descriptions.description import from_values
from robots.schema.description_checks import Problem
from robots.schema.robot_toml import DhDescription, UrdfDescription

JOINT: dict[str, Any] = {
    "a": 0.0, "alpha": 90.0, "d": 100.0, "limits": [-90.0, 90.0],
    "max_speed": 90.0, "max_acceleration": 360.0, "max_jerk": 3600.0,
}  # fmt: skip
ARM: dict[str, Any] = {"name": "arm", "joint": [{"name": "waist", **JOINT}, {"name": "elbow", **JOINT}]}
URDF = """<robot name="u"><link name="l0"/><link name="l1"/><link name="l2"/>
<joint name="j1" type="revolute"><parent link="l0"/><child link="l1"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" velocity="2" effort="0"/></joint>
<joint name="j2" type="prismatic"><parent link="l1"/><child link="l2"/><axis xyz="1 0 0"/>
  <limit lower="0.2" upper="0.4" velocity="2" effort="0"/></joint></robot>"""


def changed(path: tuple[str | int, ...], value: object) -> dict[str, Any]:
    values = deepcopy(ARM)
    node: Any = values
    for step in path[:-1]:
        node = node.setdefault(step, {}) if isinstance(node, dict) else node[step]
    node[path[-1]] = value
    return values


def problems(values: dict[str, Any], folder: Path = Path("/nowhere"), **options: bool) -> list[Problem]:
    description, found = from_values(values, folder=folder, **options)
    assert (description is None) == bool(found)
    return list(found)


def test_valid_values_give_a_description_without_problems() -> None:
    description, found = from_values(ARM, folder=Path("/nowhere"))
    assert found == ()
    assert isinstance(description, DhDescription)
    assert description.source == Path("/nowhere/robot.toml")


@pytest.mark.parametrize(
    ("path", "value", "text"),
    [
        (("joint", 1, "limits"), [5.0, -5.0],
         "joint 'elbow' limits = [5, -5]: the lower must be below the upper"),
        (("joint", 1, "home"), 100.0, "joint 'elbow' home = 100: must be within its limits -90 to 90 deg"),
        (("joint", 0, "a"), 200_000.0, "joint 'waist' a = 200000.0: more than 100 m; is it in mm?"),
        (("joint", 0, "d"), float("nan"), "joint 'waist' d = nan: must be a finite number"),
        (("joint", 0, "max_speed"), 0.0, "joint 'waist' max_speed = 0.0: must be greater than 0"),
        (("tool", "xyz"), [0.0, 0.0, -1e6],
         "tool xyz = [0.0, 0.0, -1000000.0]: more than 100 m; is it in mm?"),
        (("joint", 1, "link"), {"mesh": "m.stl"},
         "link 'elbow' mesh = 'm.stl': no such file in the description's folder"),
        (("joint", 1, "lim"), 1.0, "joint 'elbow' lim: unknown key; did you mean 'limits'?"),
        (("base", "mesh"), "a\0b", "link 'base' mesh = 'a\\x00b': not a valid file name"),
    ],
)  # fmt: skip
def test_problem_has_the_path_of_its_value(path: tuple[str | int, ...], value: object, text: str) -> None:
    (problem,) = problems(changed(path, value))
    expected = (*path, "mesh") if path[-1] == "link" else path
    assert problem == Problem(expected, text)


def test_wrong_types_hide_neither_missing_shapes_nor_what_is_wrong_elsewhere() -> None:
    values = deepcopy(ARM)
    values["joint"][0]["a"] = "long"
    values["joint"][1] |= {"limits": [1.0, -1.0], "link": {"mesh": "none.wrl"}}
    values["view"] = {"top": {"eye": [0.0, 0.0, 1.0], "target": [0.0, 0.0, 0.0]}}
    assert [problem.path for problem in problems(values)] == [
        ("joint", 0, "a"),
        ("joint", 1, "limits"),
        ("view", "top", "up"),
        ("joint", 1, "link", "mesh"),
    ]


def test_confined_values_reach_no_file_outside_the_folder(tmp_path: Path) -> None:
    inside = tmp_path / "arm"
    inside.mkdir()
    for path in (tmp_path / "out.stl", inside / "in.stl"):
        path.write_text("solid a\nendsolid a\n")
    (inside / "link.stl").symlink_to(tmp_path / "out.stl")
    for geometry in ("../out.stl", str(tmp_path / "out.stl"), "link.stl", "../none.stl"):
        values = changed(("base", "mesh"), geometry)
        (problem,) = problems(values, inside, confined=True)
        # A long path is shortened in the middle of the text.
        assert problem.text.startswith(f"link 'base' mesh = {geometry!r}"[:60])
        assert problem.text.endswith(": must be in the description's folder")
    assert problems(changed(("base", "mesh"), "in.stl"), inside, confined=True) == []
    # A description that is not confined may name files anywhere.
    assert problems(changed(("base", "mesh"), "../out.stl"), inside) == []


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "u.urdf").write_text(URDF)
    return tmp_path


def test_description_adds_values_that_urdf_does_not_have(folder: Path) -> None:
    from robots.kinematics.joints import joints_of

    values = {
        "name": "u", "urdf": "u.urdf", "tool": {"link": "l1", "xyz": [0.0, 0.0, 10.0]},
        "joint": [{"name": "j2", "home": 300.0, "limits": [250.0, 350.0], "max_speed": 10.0}],
    }  # fmt: skip
    description, found = from_values(values, folder=folder)
    assert found == ()
    assert isinstance(description, UrdfDescription)
    joints = joints_of(description)
    assert joints.names == ("j1", "j2")
    assert joints.lower.tolist() == [-1.0, 0.25]
    assert joints.home.tolist() == pytest.approx([0.0, 0.3])
    assert joints.max_speed.tolist() == [2.0, 0.01]
    assert joints.max_acceleration.tolist() == pytest.approx([8.0, 0.04])


def test_default_home_is_zero_or_the_middle_of_the_limits(folder: Path) -> None:
    from robots.kinematics.joints import joints_of

    description, _ = from_values({"name": "u", "urdf": "u.urdf"}, folder=folder)
    assert description is not None
    assert joints_of(description).home.tolist() == pytest.approx([0.0, 0.3])


@pytest.mark.parametrize(
    ("key", "value", "path", "text"),
    [
        ("joint", [{"name": "j3"}], ("joint", 0, "name"),
         "joint 'j3': the URDF has no such movable joint"),
        ("joint", [{"name": "j1"}] * 2, ("joint", 0, "name"),
         "joint 'j1': 2 tables have that name; keep one"),
        ("joint", [{"name": "j2", "limits": [0, 300.0]}], ("joint", 0, "limits"),
         "joint 'j2' limits = [0, 300]: must be within the URDF's 200 to 400 mm"),
        ("joint", [{"name": "j2", "home": 0.0}], ("joint", 0, "home"),
         "joint 'j2' home = 0: must be within its limits 200 to 400 mm"),
        ("joint", [{"name": "j2", "a": 0.0}], ("joint", 0, "a"), "joint 'j2' a: unknown key"),
        ("tool", {"link": "l9"}, ("tool", "link"), "tool link = 'l9': the URDF has no such link"),
        ("link", [{"name": "l9", "color": "#ffffff"}], ("link", 0, "name"),
         "link name = 'l9': the URDF has no such"),
        ("frame", [{"name": "l1", "link": "l2"}], ("frame", 0, "name"),
         "name 'l1': 2 links or frames have it"),
        ("collision", {"ignore": [["l0", "l9"]]}, ("collision", "ignore", 0),
         "collision ignore = ['l0', 'l9']"),
        ("constraint", [{"joints": {"j1": 1.0, "j2": 1.0}, "limits": [-1, 1]}], ("constraint", 0, "joints"),
         "constraint on j1 and j2: adds degrees to millimetres"),
        ("urdf", "none.urdf", ("urdf",), "urdf = 'none.urdf': no such file in the description's folder"),
        ("packages", ["none"], ("packages", 0),
         "packages 'none': no such folder in the description's folder"),
    ],
)  # fmt: skip
def test_values_that_do_not_fit_the_urdf_are_reported(
    key: str, value: object, path: tuple[str | int, ...], text: str, folder: Path
) -> None:
    found = problems({"name": "u", "urdf": "u.urdf", key: value}, folder)
    assert found[0].path == path
    assert found[0].text.startswith(text)


def test_problems_in_the_urdf_are_reported_at_its_key(folder: Path) -> None:
    (folder / "u.urdf").write_text(URDF.replace('upper="1"', 'upper="-2"'))
    (problem,) = problems({"name": "u", "urdf": "u.urdf"}, folder)
    assert problem.path == ("urdf",)
    assert problem.text == "joint 'j1' limit lower = -1, upper = -2: lower must be less than upper"


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3),
    max_leaves=8,
)
KEYS = st.sampled_from(
    ["name", "units", "base", "joint", "tool", "frame", "constraint", "view", "collision", "urdf", "packages"]
)


@settings(max_examples=100)
@given(
    st.dictionaries(KEYS, JSON, max_size=4),
    st.dictionaries(st.sampled_from([*JOINT, "name", "link"]), JSON, max_size=4),
)
def test_any_values_give_problems_and_no_exception(top: dict[str, Any], row: dict[str, Any]) -> None:
    values = {**deepcopy(ARM), **top}
    if isinstance(values["joint"], list) and values["joint"]:
        values["joint"][0] = {**values["joint"][0], **row} if isinstance(values["joint"][0], dict) else row
    for problem in problems(values, confined=True):
        assert problem.text
        assert "\n" not in problem.text
        assert len(problem.text) < 2000
