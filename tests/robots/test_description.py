"""Description files: their values, and the problems of wrong ones."""

from pathlib import Path

import pytest

from robots.descriptions.description import JointType, library_names, load, parse
from robots.schema.errors import DescriptionError

GOOD = """
name = "small"
title = "Small"

[[joint]]
name = "waist"
a = 0.0
alpha = 90.0
d = 100.0
limits = [-90.0, 90.0]
max_speed = 90.0
max_acceleration = 360.0
max_jerk = 3600.0
link = { name = "column" }

[[joint]]
name = "slide"
type = "prismatic"
a = 0.0
alpha = 0.0
d = 50.0
limits = [0.0, 200.0]
max_speed = 100.0
max_acceleration = 400.0
max_jerk = 4000.0
"""
FOLDER = Path("robot.toml")


def with_change(old: str, new: str) -> str:
    assert old in GOOD
    return GOOD.replace(old, new, 1)


def test_description_keeps_the_files_own_units() -> None:
    description = parse(GOOD, FOLDER)
    assert description.joints[0].limits == (-90.0, 90.0)
    assert description.joints[1].d == 50.0
    assert description.joints[1].type is JointType.PRISMATIC


def test_link_is_named_as_its_joint_unless_it_says_otherwise() -> None:
    assert parse(GOOD, FOLDER).link_names == ("base", "column", "slide")


def test_library_has_the_papers_two_robots_and_a_third() -> None:
    assert library_names() == ("pt500", "pt600", "puma560")
    for name in library_names():
        assert load(name).name == name


@pytest.mark.parametrize("name", ["pt500", "pt600"])
def test_robots_without_published_dimensions_say_so(name: str) -> None:
    assert "nominal, not measured" in load(name).provenance


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('name = "waist"', 'nane = "waist"', "joint number 1 nane: unknown key; did you mean 'name'?"),
        ("d = 100.0", "dd = 100.0", "joint 'waist' dd: unknown key"),
        ("d = 100.0\n", "", "joint 'waist' d is missing"),
        ("a = 0.0", 'a = "long"', "joint 'waist' a = 'long': must be a valid number"),
        ("a = 0.0", "a = true", "joint 'waist' a = True: must be a valid number"),
        ("a = 0.0", "a = nan", "joint 'waist' a = nan: must be a finite number"),
        ("max_speed = 90.0", "max_speed = -1.0", "joint 'waist' max_speed = -1.0: must be greater than 0"),
        (
            'type = "prismatic"',
            'type = "ball"',
            "joint 'slide' type = 'ball': must be 'rotary' or 'prismatic'",
        ),
        (
            "limits = [-90.0, 90.0]",
            "limits = [90.0, -90.0]",
            "joint 'waist' limits = [90, -90]: the lower must be below the upper",
        ),
        (
            "max_jerk = 3600.0",
            "max_jerk = 3600.0\nhome = 91.0",
            "joint 'waist' home = 91: must be within its limits -90 to 90 deg",
        ),
        (
            "max_jerk = 4000.0",
            "max_jerk = 4000.0\nhome = 201.0",
            "joint 'slide' home = 201: must be within its limits 0 to 200 mm",
        ),
        ('name = "slide"', 'name = "waist"', "joint 'waist': 2 joints have that name; each needs its own"),
        (
            'name = "column"',
            'name = "base"',
            "name 'base': 2 links or frames have it ('base' is reserved)",
        ),
        (
            'link = { name = "column" }',
            'link = { name = "column", color = "orange" }',
            "joint 'waist' link color = 'orange': must match pattern",
        ),
        (
            'link = { name = "column" }',
            'link = { name = "column", mesh = "meshes/none.wrl" }',
            "link 'column' mesh = 'meshes/none.wrl': no such file in the description's folder",
        ),
        ('title = "Small"', 'name2 = "Small"', "name2: unknown key; did you mean 'name'?"),
        ('title = "Small"', 'units = { length = "inch" }', "units length = 'inch': must be 'mm' or 'm'"),
        ('name = "small"', 'name = "Small One"', "name = 'Small One': must match pattern"),
    ],
)
def test_wrong_value_is_reported_with_key_and_right_range(old: str, new: str, expected: str) -> None:
    with pytest.raises(DescriptionError) as caught:
        parse(with_change(old, new), Path("arm/robot.toml"))
    assert str(caught.value).startswith(f"arm/robot.toml: {expected}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("added", "expected"),
    [
        (
            '[[frame]]\nname = "camera"\nlink = "colum"',
            "frame 'camera' link = 'colum': no such link; did you mean 'column'?",
        ),
        ('[[frame]]\nname = "tool"\nlink = "column"', "name 'tool': 2 links or frames have it"),
        ('[collision]\nignore = [["base", "arm"]]', "collision ignore = ['base', 'arm']: no link 'arm'"),
        (
            "[[constraint]]\njoints = { wast = 1.0 }\nlimits = [0, 1]",
            "constraint joints: no joint 'wast'; did you mean 'waist'?",
        ),
        (
            "[[constraint]]\njoints = { waist = 1.0 }\nlimits = [2, 1]",
            "constraint limits = [2, 1]: the lower must be below",
        ),
        (
            "[[constraint]]\njoints = { waist = 1.0 }\nlimits = [10, 20]",
            "constraint on waist limits = [10, 20]: home gives 0, outside them",
        ),
        (
            "[[constraint]]\njoints = { waist = 1.0, slide = 1.0 }\nlimits = [-9, 9]",
            "constraint on waist and slide: adds degrees to millimetres",
        ),
        (
            "[view.top]\neye = [0, 0, 9]\ntarget = [0, 0, 0]",
            "view 'top' up = [0.0, 0.0, 1.0]: must not be zero or along the line from eye to target",
        ),
    ],
)
def test_unknown_reference_is_reported(added: str, expected: str) -> None:
    with pytest.raises(DescriptionError) as caught:
        parse(f"{GOOD}\n{added}\n", FOLDER)
    assert caught.value.problems[0].startswith(expected)


def test_all_problems_are_found_at_once() -> None:
    text = with_change("a = 0.0", 'a = "x"').replace("d = 50.0", "d = inf")
    with pytest.raises(DescriptionError) as caught:
        parse(text, FOLDER)
    assert len(caught.value.problems) == 2
    assert str(caught.value).endswith("(and 1 more problem)")


def test_invalid_toml_is_reported_with_its_line() -> None:
    with pytest.raises(DescriptionError, match=r"robot\.toml: is not TOML: .*line 2"):
        parse("\nname == 1", FOLDER)


def test_unknown_robot_gets_the_most_similar_name() -> None:
    with pytest.raises(DescriptionError, match="pt60: no such robot in the library; did you mean 'pt600'"):
        load("pt60")


def test_folder_of_the_same_name_does_not_hide_a_library_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pt600").mkdir()
    monkeypatch.chdir(tmp_path)
    assert load("pt600").title == "Pt600"


def test_missing_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match=r"arm\.toml: cannot be read: No such file"):
        load(tmp_path / "arm.toml")


def test_missing_urdf_is_reported() -> None:
    with pytest.raises(
        DescriptionError, match=r"urdf = 'arm\.urdf': no such file in the description's folder"
    ):
        parse('name = "arm"\nurdf = "arm.urdf"', FOLDER)


def test_path_folder_and_name_load_the_same(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(GOOD)
    assert load(tmp_path) == load(str(tmp_path / "robot.toml")) == parse(GOOD, tmp_path / "robot.toml")
    assert load(tmp_path).text == GOOD
