"""Limits of a URDF's joints that no arm has: named with what was probably meant, until they are stated."""

from math import pi, radians
from pathlib import Path

import numpy as np
import pytest

from robots.descriptions.description import library_names, load
from robots.descriptions.importing import import_robot
from robots.descriptions.save_description import write_folder
from robots.descriptions.shape_inspection import inspect_shapes
from robots.descriptions.urdf.write import to_urdf
from robots.kinematics.joints import doubt_notes, doubt_texts, joints_of
from robots.schema.errors import DescriptionError
from robots.schema.robot_toml import JointSettings, StatedModel
from tests.robots.boxes import one_joint_arm

RAD, DEGREES = "-6.2832 to 6.2832 rad is assumed", "; probably degrees: "


@pytest.mark.parametrize(
    ("kind", "limit", "text", "values"),
    [
        ("revolute", 'lower="-180" upper="180" velocity="2"',
         f"lower = -180 rad is 28 turns{DEGREES}-3.1416 to 3.1416 rad", (-pi, pi, 2)),
        ("revolute", 'lower="0" upper="360" velocity="90"',
         (f"upper = 360 rad is 57 turns{DEGREES}0 to 6.2832 rad; "
          "velocity = 90 rad/s is 14 turns/s; probably degrees/s: 1.5708 rad/s"), (0, 2 * pi, pi / 2)),
        ("revolute", 'lower="-1" upper="1" velocity="180"',
         "velocity = 180 rad/s is 28 turns/s; probably degrees/s: 3.1416 rad/s", (-1, 1, pi)),
        ("revolute", 'lower="-1" upper="1" velocity="1e6"',
         "velocity = 1e+06 rad/s is 159,154 turns/s; 1.571 rad/s is assumed", (-1, 1, pi / 2)),
        ("revolute", 'lower="-1" upper="1" velocity="0"',
         "has no velocity limit; 1.571 rad/s is assumed", (-1, 1, pi / 2)),
        ("revolute", 'lower="-1" upper="1"',
         "has no velocity limit; 1.571 rad/s is assumed", (-1, 1, pi / 2)),
        ("revolute", 'lower="-999999" upper="999999" velocity="2"',
         f"lower = -999999 rad is 159,154 turns; {RAD}", (-2 * pi, 2 * pi, 2)),
        ("revolute", 'lower="-1" upper="1e300" velocity="2"',
         "upper = 1e+300 rad; -1 to 6.2832 rad is assumed", (-1, 2 * pi, 2)),
        ("revolute", 'velocity="20"',
         f"lower and upper are zero or not stated; {RAD}", (-2 * pi, 2 * pi, 20)),
        ("revolute", 'lower="0" upper="0" velocity="1"',
         f"lower and upper are zero or not stated; {RAD}", (-2 * pi, 2 * pi, 1)),
        ("revolute", 'upper="2" velocity="1"', "lower is not stated; zero is assumed", (0, 2, 1)),
        ("continuous", 'velocity="1000000"',
         "velocity = 1e+06 rad/s is 159,154 turns/s; 1.571 rad/s is assumed", (-2 * pi, 2 * pi, pi / 2)),
        ("prismatic", 'lower="0" upper="500" velocity="0.5"',
         "upper = 500 m; probably millimetres: 0 to 0.5 m", (0, 0.5, 0.5)),
        ("prismatic", 'lower="0" upper="0.5" velocity="250"',
         "velocity = 250 m/s; probably millimetres/s: 0.25 m/s", (0, 0.5, 0.25)),
        ("prismatic", 'lower="-1e9" upper="1e9" velocity="1"',
         "lower = -1e+09 m; -1 to 1 m is assumed", (-1, 1, 1)),
    ],
)  # fmt: skip
def test_a_doubtful_limit_is_named_and_stays_doubtful_when_it_is_written(
    tmp_path: Path, kind: str, limit: str, text: str, values: tuple[float, ...]
) -> None:
    description = load(one_joint_arm(tmp_path, limit, kind))
    joints = joints_of(description)
    assert doubt_texts(joints) == {"j1": text}
    np.testing.assert_allclose((joints.lower[0], joints.upper[0], joints.max_speed[0]), values)
    _, warnings = inspect_shapes(description)
    assert [each.text for each in warnings] == [*doubt_notes(description)]
    again = tmp_path / "again.urdf"
    again.write_text(to_urdf(description, shape_uri=lambda _: "arm.urdf"))
    assert joints_of(load(again)).doubts == joints.doubts
    imported = import_robot(str(description.source))
    assert doubt_notes(description)[0] in imported.notes
    write_folder(imported.values, imported.files, tmp_path / "imported")
    assert joints_of(load(tmp_path / "imported")).doubts == joints.doubts


@pytest.mark.parametrize(
    ("kind", "limit"),
    [
        ("continuous", 'velocity="3"'),
        ("continuous", ""),
        ("revolute", 'lower="-12.57" upper="12.57" velocity="52.4"'),
        ("revolute", 'lower="0" upper="1.5" velocity="100"'),
        ("prismatic", 'lower="0" upper="12" velocity="5"'),
    ],
)
def test_a_limit_that_an_arm_can_have_is_not_doubtful(tmp_path: Path, kind: str, limit: str) -> None:
    assert joints_of(load(one_joint_arm(tmp_path, limit, kind))).doubts == {}


def test_robots_of_the_library_have_no_doubtful_limits() -> None:
    for name in library_names():
        assert joints_of(load(name)).doubts == {}


def test_stated_limits_end_the_doubt(tmp_path: Path) -> None:
    urdf = one_joint_arm(tmp_path, 'lower="-180" upper="180" velocity="180"')
    (tmp_path / "robot.toml").write_text(
        'name = "arm"\nurdf = "arm.urdf"\n'
        '[[joint]]\nname = "j1"\nlimits = [-200.0, 200.0]\nmax_speed = 90.0\n'
    )
    both = JointSettings(name="j1", limits=(-200.0, 200.0), max_speed=90.0)
    for model in (tmp_path, StatedModel(model=str(urdf), joints=(both,))):
        joints = joints_of(load(model))
        assert joints.doubts == {}
        assert (joints.upper[0], joints.max_speed[0]) == pytest.approx((radians(200), radians(90)))
    only_limits = JointSettings(name="j1", limits=(-200.0, 200.0))
    (doubt,) = doubt_texts(joints_of(load(StatedModel(model=str(urdf), joints=(only_limits,))))).values()
    assert doubt.startswith("velocity = 180 rad/s")


def test_stated_limits_are_checked(tmp_path: Path) -> None:
    urdf = str(one_joint_arm(tmp_path, 'lower="-1" upper="1" velocity="1"'))
    for model, row, words in (
        (urdf, JointSettings(name="j1", limits=(-90.0, 90.0)), "must be within the URDF's"),
        (urdf, JointSettings(name="j2", max_speed=1.0), "no such movable joint"),
        ("pt600", JointSettings(name="j1", max_speed=1.0), "change limits and max_speed in its robot.toml"),
    ):
        with pytest.raises(DescriptionError, match=words):
            load(StatedModel(model=model, joints=(row,)))


def test_assumed_limits_must_be_stated_in_a_table_of_rows(tmp_path: Path) -> None:
    found = import_robot(str(one_joint_arm(tmp_path, 'velocity="1e6"')), as_dh=True)
    row = found.values["joint"][0]
    assert (row["limits"], row["max_speed"]) == ([0.0, 0.0], 0.0)
    assert any("j1" in note and "not stated" in note for note in found.notes)
    write_folder(found.values, found.files, tmp_path / "rows")
    with pytest.raises(DescriptionError, match="max_speed"):
        load(tmp_path / "rows")
