"""Robots of a mesh as one URDF: read back by Pinocchio, each has its placement in the site."""

from dataclasses import replace
from xml.etree import ElementTree as Xml

import numpy as np
import pinocchio
import pytest

from robots.descriptions.description import load
from robots.descriptions.urdf.viewers import WORLD, Viewed, prefixed, together
from robots.descriptions.urdf.write import to_urdf
from robots.kinematics.model import build_model, link_placements

POSES = {
    "upright": pinocchio.SE3(pinocchio.rpy.rpyToMatrix(0.3, -0.4, 2.0), np.array([1.0, -2.0, 0.5])),
    "nose-down": pinocchio.SE3(pinocchio.rpy.rpyToMatrix(0.7, np.pi / 2, 0.2), np.array([0.0, 1.0, 3.0])),
    "nose-up": pinocchio.SE3(pinocchio.rpy.rpyToMatrix(0.0, -np.pi / 2, -1.0), np.zeros(3)),
}


def viewed(site, robot, pose):
    urdf = to_urdf(load(robot))
    return Viewed(site, robot, urdf, tuple(pose.homogeneous.ravel()), lambda link: f"file:///{link}.glb")


@pytest.mark.parametrize("pose", POSES.values(), ids=POSES)
def test_every_link_of_every_robot_has_its_placement_in_the_site(pose):
    robots = [viewed("hall", "pt600", pose), viewed("hall", "puma560", pinocchio.SE3.Identity())]
    whole = pinocchio.buildModelFromXML(together(robots, joints="prefixed"))
    generator = np.random.default_rng(5)
    for robot, base_to_site in (("pt600", pose), ("puma560", pinocchio.SE3.Identity())):
        model = build_model(load(robot))
        positions = generator.uniform(model.joints.lower, model.joints.upper)
        positions_of_all = pinocchio.neutral(whole)
        for name, position in zip(model.joints.names, positions, strict=True):
            positions_of_all[whole.joints[whole.getJointId(f"hall/{robot}/{name}")].idx_q] = position
        data = whole.createData()
        pinocchio.framesForwardKinematics(whole, data, positions_of_all)
        for name, placement in zip(model.link_names, link_placements(model, positions), strict=True):
            frame = whole.getFrameId(f"hall/{robot}/{name}", pinocchio.FrameType.BODY)
            expected = base_to_site.homogeneous @ placement
            np.testing.assert_allclose(data.oMf[frame].homogeneous, expected, atol=1e-7)


def test_several_sites_share_a_root_and_a_single_site_is_the_root():
    first, second = (viewed(site, "pt600", pinocchio.SE3.Identity()) for site in ("here", "there"))

    def roots(text):
        urdf = Xml.fromstring(text)
        children = {each.get("link") for each in urdf.iter("child")}
        return [link.get("name") for link in urdf.findall("link") if link.get("name") not in children]

    assert roots(together([first], joints="plain")) == ["here"]
    assert roots(together([first, second], joints="prefixed")) == [WORLD]
    assert pinocchio.buildModelFromXML(together([first, second], joints="prefixed")).nq == 10


def test_upper_side_of_the_floors_plate_is_at_the_floors_height():
    high, low = POSES["upright"], pinocchio.SE3.Identity()
    robots = [
        replace(viewed("hall", robot, pose), floor_m=floor_m)
        for robot, pose, floor_m in (("pt600", high, -0.25), ("puma560", low, -0.25), ("pt500", low, None))
    ]
    text = together(robots, joints="prefixed")
    (box,) = Xml.fromstring(text).findall("link[@name='hall/floor.0']/visual/geometry/box")
    size = [float(each) for each in box.get("size").split()]
    whole = pinocchio.buildModelFromXML(text)
    data = whole.createData()
    pinocchio.framesForwardKinematics(whole, data, pinocchio.neutral(whole))
    middle = data.oMf[whole.getFrameId("hall/floor.0")].translation
    assert middle[2] + size[2] / 2 == pytest.approx(-0.25)
    # Both robots are on it, with a margin around them.
    for pose in (high, low):
        assert (np.abs(pose.translation[:2] - middle[:2]) + 1.5 < np.array(size[:2]) / 2).all()


def test_plain_joints_keep_their_names_and_the_meshes_are_those_of_the_mesh():
    urdf = Xml.fromstring(together([viewed("here", "pt600", pinocchio.SE3.Identity())], joints="plain"))
    names = {joint.get("name") for joint in urdf.findall("joint")}
    assert {"waist", "elbow"} <= names
    assert {geometry.get("filename") for geometry in urdf.iter("mesh")} >= {"file:///base.glb"}
    assert not list(urdf.iter("collision"))


def test_without_joints_a_viewer_has_the_links_with_shapes_and_no_pose_of_its_own():
    arm = replace(
        viewed("here", "pt600", POSES["upright"]),
        shape_uri=lambda link: None if link.endswith("_axis") else f"{link}.glb",
    )
    urdf = Xml.fromstring(together([arm], joints="none"))
    links = {link.get("name") for link in urdf.findall("link")}
    assert {"here", "here/pt600/base", "here/pt600/flange"} <= links
    assert not [name for name in links if name.endswith("_axis")]
    assert not urdf.findall("joint")


def test_mimic_joint_follows_the_renamed_joint():
    text = """<robot name="g"><link name="a"/><link name="b"/><joint name="two" type="revolute">
    <parent link="a"/><child link="b"/><mimic joint="one"/></joint></robot>"""
    joint = prefixed(text, "s/g/", lambda link: None, prefix_joints=True).find("joint")
    assert (joint.get("name"), joint.find("mimic").get("joint")) == ("s/g/two", "s/g/one")


def test_invalid_urdf_is_left_out_and_the_others_stay():
    bad = Viewed("here", "bad", "<robot", (), lambda link: None)
    text = together([bad, viewed("here", "pt600", pinocchio.SE3.Identity())], joints="prefixed")
    assert "here/pt600/base" in text
    with pytest.raises(ValueError, match="is not a URDF"):
        prefixed("<robot", "", lambda link: None)
