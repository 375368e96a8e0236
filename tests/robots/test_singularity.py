"""Distance of an arm from singular positions: 0 in one, and independent of the unit of length."""

import numpy as np
import pytest

from robots.descriptions.description import load
from robots.kinematics.model import build_model, manipulability, tool_jacobian
from robots.kinematics.singularity import arm_length, dexterity, singularity_margin
from robots.schema.robot_toml import Pose


def margin(name, degrees):
    description = load(name)
    return singularity_margin(build_model(description), np.radians(degrees), reach=arm_length(description))


def test_the_reach_is_the_arms_length_from_its_first_joint_to_its_tool():
    # Pt600: rows d 0.35, a 0.30, a 0.30; tool 0.12.
    assert arm_length(load("pt600")) == pytest.approx(0.35 + 0.30 + 0.30 + 0.12)


def test_the_place_of_the_first_joint_on_the_base_is_no_part_of_the_reach():
    description = load("pt600")
    base = description.base.model_copy(update={"pose": Pose(xyz=(0.0, 0.0, 500.0))})
    assert arm_length(description.model_copy(update={"base": base})) == arm_length(description)


@pytest.mark.parametrize(
    ("name", "stretched", "bent"),
    [
        # A straight elbow cannot move the tool along the arm; a straight wrist cannot rotate it one way.
        ("pt600", [10, 40, 0, -40, 0], [10, 40, 60, -40, 0]),
        ("puma560", [10, 40, 60, 0, 0, 0], [10, 40, 10, 30, 60, 20]),
    ],
)
def test_margin_is_zero_only_in_singular_positions(name, stretched, bent):
    assert margin(name, bent) > 0.02
    assert margin(name, stretched) < 1e-9


@pytest.mark.parametrize("name", ["pt600", "puma560"])
def test_both_measures_of_one_decomposition_are_those_of_their_own(name):
    description = load(name)
    model, reach = build_model(description), arm_length(description)
    for positions in np.random.default_rng(1).uniform(-1.0, 1.0, (20, len(model.joints))):
        manipulable, margin = dexterity(tool_jacobian(model, positions), model.joints.types, reach=reach)
        assert manipulable == pytest.approx(manipulability(model, positions), abs=1e-12)
        assert margin == pytest.approx(singularity_margin(model, positions, reach=reach), abs=1e-12)


def test_margin_does_not_depend_on_the_arms_size(tmp_path):
    library = load("pt600").source
    lines = library.read_text(encoding="utf-8").splitlines()
    doubled = [
        f"{key}= {2 * float(value)}" if (key := line.partition("=")[0]).strip() in ("a", "d") else line
        for line in lines
        for value in [line.partition("=")[2].partition("#")[0].strip()]
    ]
    text = "\n".join(doubled).replace("xyz = [0.0, 0.0, 120.0]", "xyz = [0.0, 0.0, 240.0]")
    (tmp_path / "robot.toml").write_text(text, encoding="utf-8")
    (tmp_path / "meshes").symlink_to(library.parent / "meshes")
    twice = load(tmp_path / "robot.toml")
    assert arm_length(twice) == pytest.approx(2 * arm_length(load("pt600")))
    positions = [10, 40, 60, -40, 5]
    own = singularity_margin(build_model(twice), np.radians(positions), reach=arm_length(twice))
    assert own == pytest.approx(margin("pt600", positions))
