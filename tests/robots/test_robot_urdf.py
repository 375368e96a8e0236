"""URDF export, read back by Pinocchio."""

from xml.etree import ElementTree as Xml

import numpy as np
import pinocchio
import pytest

from robots.description import library_names, load
from robots.model import build_model, link_placements, tool_placement
from robots.urdf import to_urdf


@pytest.mark.parametrize("robot", library_names())
def test_exported_robot_stands_where_the_described_one_does(robot: str) -> None:
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


def test_every_link_names_its_glb() -> None:
    text = to_urdf(load("pt600"), mesh_uri=lambda link: f"robomesh://{link}")
    names = [mesh.get("filename") for mesh in Xml.fromstring(text).findall("link/visual/geometry/mesh")]
    assert names == [f"robomesh://{link}" for link in load("pt600").link_names]
