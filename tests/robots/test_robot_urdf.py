"""URDF export, read back by Pinocchio."""

from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import pinocchio
import pytest

from robots.descriptions.description import library_names, load, parse
from robots.descriptions.urdf.read import read_urdf
from robots.descriptions.urdf.write import to_urdf
from robots.descriptions.urdf_to_dh import dh_form
from robots.kinematics.model import build_model, link_placements, tool_placement
from robots.schema.robot_toml import UrdfDescription


@pytest.mark.parametrize("robot", library_names())
def test_exported_robot_has_the_placements_of_the_described_one(robot: str) -> None:
    description = load(robot)
    model = build_model(description)
    exported = pinocchio.buildModelFromXML(to_urdf(description))
    data = exported.createData()

    def placement(name: str) -> np.ndarray:
        frame = exported.getFrameId(name, pinocchio.FrameType.BODY)
        return np.array(data.oMf[frame].homogeneous)

    assert tuple(exported.names[1:]) == model.joints.names
    np.testing.assert_allclose(exported.lowerPositionLimit, model.joints.lower)
    np.testing.assert_allclose(exported.upperPositionLimit, model.joints.upper)
    generator = np.random.default_rng(3)
    for _ in range(100):
        positions = generator.uniform(model.joints.lower, model.joints.upper)
        pinocchio.framesForwardKinematics(exported, data, positions)
        for name, expected in zip(model.link_names, link_placements(model, positions), strict=True):
            np.testing.assert_allclose(placement(name), expected, atol=1e-9)
        np.testing.assert_allclose(placement("tool"), tool_placement(model, positions), atol=1e-9)


CLASHING = """
name = "clash"
{joints}
[[frame]]
name = "a_axis"
link = "{link}"
xyz = [1.0, 2.0, 3.0]
"""
JOINT = """[[joint]]
name = "{name}"
a = 100.0
alpha = 0.0
d = 50.0
limits = [-90.0, 90.0]
max_speed = 1.0
max_acceleration = 1.0
max_jerk = 1.0
link = {{ name = "{link}" }}
"""


def test_frames_and_joints_keep_names_that_the_export_would_use(tmp_path: Path) -> None:
    joints = JOINT.format(name="a", link="one") + JOINT.format(name="one_fixed", link="two")
    description = parse(CLASHING.format(joints=joints, link="one"), tmp_path / "robot.toml")
    exported = to_urdf(description)
    read = read_urdf(exported, tmp_path / "clash.urdf", resolve=lambda address: None)
    assert [joint.name for joint in read.tree.joints] == ["a", "one_fixed"]
    links = {link.name: link for link in read.tree.links}
    # After a's axis: the link at d 50 mm and a 100 mm, and the frame relative to it.
    np.testing.assert_allclose(links["one"].link_to_joint[:3, 3], [0.1, 0.0, 0.05])
    np.testing.assert_allclose(links["a_axis"].link_to_joint[:3, 3], [0.101, 0.002, 0.053])
    assert links["a_axis"].joint == 0
    # Converted back to rows, there is this frame and no other.
    (tmp_path / "clash.urdf").write_text(exported)
    by_urdf = parse('name = "clash"\nurdf = "clash.urdf"\n', tmp_path / "robot.toml")
    assert isinstance(by_urdf, UrdfDescription)
    assert dh_form(by_urdf).values["frame"] == [
        {"name": "a_axis", "link": "one", "xyz": [1.0, 2.0, 3.0], "rpy": [0.0, 0.0, 0.0]}
    ]


def test_every_link_names_its_glb() -> None:
    text = to_urdf(load("pt600"), shape_uri=lambda link: f"robomesh://{link}")
    names = [
        geometry.get("filename") for geometry in Xml.fromstring(text).findall("link/visual/geometry/mesh")
    ]
    assert names == [f"robomesh://{link}" for link in load("pt600").link_names]
