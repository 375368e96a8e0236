"""The robots of example-robot-data: each loads with Pinocchio's placements, or is refused with a reason."""

from functools import cache
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from robots.collision import allowed_positions, build_cell, own_contacts
from robots.descriptions.cells import CellDescription, CellRobot
from robots.descriptions.description import EXAMPLES, from_values, known_names, library_names, load
from robots.descriptions.example_robots import example_folder
from robots.descriptions.glb import link_glbs
from robots.descriptions.urdf.write import to_urdf
from robots.descriptions.urdf_to_dh import dh_form
from robots.kinematics.joints import violations
from robots.kinematics.model import RobotModel, build_model, link_placements, tool_placement
from robots.schema.errors import DescriptionError
from robots.schema.robot_toml import UrdfDescription

FOLDER = example_folder()
installed = pytest.mark.skipif(FOLDER is None, reason="the extra example-robots is not installed")
FILES = [] if FOLDER is None else sorted(str(path.relative_to(FOLDER)) for path in FOLDER.rglob("*.urdf"))
NAMES = () if FOLDER is None else tuple(EXAMPLES)
NAMED = {file: name for name, file in EXAMPLES.items()}
REFUSED = {
    "alex_description/urdf/alex_psyonic_hands.urdf": "mimic joint 'index_q1': no such movable joint",
    "hector_description/robots/quadrotor_base.urdf": "has no movable joint",
    "iris_description/robots/iris_simple.urdf": "has no movable joint",
    "ur_description/urdf/ur3.urdf": "has no <link>",
}

loaded = cache(load)


def test_error_without_the_package_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robots.descriptions.example_robots.example_folder", lambda: None)
    with pytest.raises(
        DescriptionError, match=r"ur5: .* not installed .* Run \./dev example-robots or pip install"
    ):
        load("ur5")
    assert known_names() == library_names()


@installed
def test_known_names_include_example_robots() -> None:
    assert {"pt600", "ur5", "panda"} <= set(known_names())
    with pytest.raises(DescriptionError, match="did you mean 'panda'"):
        load("pandda")


@pytest.mark.slow
@installed
@pytest.mark.parametrize("file", FILES)
def test_every_robot_equals_pinocchios_or_is_refused_with_a_reason(file: str) -> None:
    assert FOLDER is not None
    if file in REFUSED:
        with pytest.raises(DescriptionError, match=REFUSED[file]):
            load(FOLDER / file)
        return
    description = loaded(NAMED.get(file, FOLDER / file))
    assert isinstance(description, UrdfDescription)
    model = build_model(description)
    compare(model, description, pinocchio.buildModelFromXML((FOLDER / file).read_text()))


def compare(model: RobotModel, description: UrdfDescription, other: pinocchio.Model) -> None:
    data = other.createData()
    tree = description.robot.tree
    names = [name for name in model.link_names if other.existFrame(name, pinocchio.FrameType.BODY)]
    # All except joints with names that were made safe.
    assert len(names) >= len(model.link_names) - sum("is called" in note for note in description.robot.notes)
    random = np.random.default_rng(2)
    for _ in range(5):
        own = dict(zip(model.joints.names, random.uniform(-1.0, 1.0, len(model.joints)), strict=True))
        positions = pinocchio.neutral(other)
        for joint in tree.joints:
            if joint.mimic is None:
                value = own[joint.name]
            else:
                leader = tree.joints[joint.mimic.leader].name
                value = joint.mimic.multiplier * own[leader] + joint.mimic.offset
            joint_model = other.joints[other.getJointId(joint.name)]
            if joint_model.nq:  # the name may have been made safe
                turned = [value] if joint_model.nq == 1 else [np.cos(value), np.sin(value)]
                positions[joint_model.idx_q : joint_model.idx_q + joint_model.nq] = turned
        pinocchio.framesForwardKinematics(other, data, positions)
        placed = dict(zip(model.link_names, link_placements(model, list(own.values())), strict=True))
        for name in names:
            frame = other.getFrameId(name, pinocchio.FrameType.BODY)
            np.testing.assert_allclose(placed[name], data.oMf[frame].homogeneous, atol=1e-12)


@pytest.mark.slow
@installed
@pytest.mark.parametrize("name", NAMES)
def test_named_robot_is_complete(name: str) -> None:
    description = loaded(name)
    assert isinstance(description, UrdfDescription)
    assert description.robot.missing == ()
    model = build_model(description)
    assert violations(model.joints, model.joints.home) == ()
    assert "example-robot-data" in description.provenance


@pytest.mark.slow
@installed
@pytest.mark.parametrize("name", NAMES)
def test_exported_robot_has_the_same_placements(name: str, tmp_path: Path) -> None:
    description = loaded(name)
    (tmp_path / "again.urdf").write_text(to_urdf(description))
    again = build_model(load(tmp_path / "again.urdf"))
    model = build_model(description)
    assert again.joints.names == model.joints.names
    np.testing.assert_array_equal(again.joints.lower, model.joints.lower)
    np.testing.assert_array_equal(again.joints.max_speed, model.joints.max_speed)
    random = np.random.default_rng(6)
    for _ in range(5):
        positions = random.uniform(model.joints.lower, model.joints.upper)
        before = dict(zip(model.link_names, link_placements(model, positions), strict=True))
        after = dict(zip(again.link_names, link_placements(again, positions), strict=True))
        for link, placement in before.items():
            np.testing.assert_allclose(after[link], placement, atol=1e-12)
        np.testing.assert_allclose(after["tool"], tool_placement(model, positions), atol=1e-12)


@installed
@pytest.mark.parametrize(
    "name", ["ur3", "ur5", "ur10", "panda", "xarm7", "z1", "kinova", "so100", "talos_arm"]
)
def test_arms_as_rows_have_the_same_tool_placement(name: str, tmp_path: Path) -> None:
    description = loaded(name)
    assert isinstance(description, UrdfDescription)
    form = dh_form(description)
    rows, problems = from_values(form.values, folder=tmp_path)
    assert rows is not None, problems
    assert not [note for note in form.notes if "nearly parallel" in note]
    before, after = build_model(description), build_model(rows)
    home = dict(zip(before.joints.names, before.joints.home, strict=True))

    def tool_before(positions: np.ndarray) -> np.ndarray:
        named_positions = home | dict(zip(after.joints.names, positions, strict=True))
        return tool_placement(before, [named_positions[joint] for joint in before.joints.names])

    base = tool_before(after.joints.home) @ np.linalg.inv(tool_placement(after, after.joints.home))
    random = np.random.default_rng(9)
    for _ in range(20):
        positions = random.uniform(after.joints.lower, after.joints.upper)
        np.testing.assert_allclose(
            base @ tool_placement(after, positions), tool_before(positions), atol=1e-12
        )


@pytest.mark.slow
@installed
@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_links_of_an_example_robot_have_bodies(name: str, tmp_path: Path) -> None:
    shapes = link_glbs(load(name), cache=tmp_path)
    assert len(shapes) >= 7
    assert all(glb.startswith(b"glTF") for glb in shapes.values())


@installed
@pytest.mark.slow
def test_ur10_is_not_refused_if_only_hulls_of_its_links_touch() -> None:
    cell = build_cell(CellDescription((CellRobot("arm", "ur10", np.eye(4)),)))
    arm = cell.arms["arm"]
    reasons = dict(arm.plan.elsewhere)
    for links in (("base_link", "upper_arm_link"), ("forearm_link", "wrist_2_link")):
        assert "checked as exact collision meshes" in reasons[links]
    positions = allowed_positions(arm.joints, 300, seed=1)
    touching = [bool(own_contacts(cell, "arm", each)) for each in positions]
    # With hulls only, it would touch itself in 41 % of them.
    assert 0.05 < np.mean(touching) < 0.25
