"""A robot's appearance from its description: chain, workspace, cameras."""

import numpy as np
import pytest

from renderer.errors import ChainError, UnknownViewError
from renderer.scene.appearance import appearance_of, home_placements
from renderer.scene.cameras import pixels
from renderer.scene.chain import placements, reach, read_chain
from renderer.scene.views import camera_of
from robomesh.schemas.robomesh_pb2 import Description, Vector3, View
from robots.descriptions.description import load
from robots.descriptions.urdf.write import to_urdf
from robots.kinematics.model import build_model, frame_placements, link_placements
from services.kinematics.descriptions import describe

SIZE = (640, 360)
ROBOTS = ("pt500", "pt600", "puma560")


def described(name, base_to_site=None):
    description = load(name)
    model = build_model(description)
    message = describe(
        description,
        urdf=to_urdf(description),
        shapes={},
        base_to_site=np.eye(4) if base_to_site is None else base_to_site,
        cell="",
        simulated=True,
    )
    return message, model


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_chain_places_links_as_the_robot_model_does(robot):
    message, model = described(robot)
    chain = read_chain(message.urdf)
    random = np.random.default_rng(3)
    for _ in range(20):
        positions = random.uniform(model.joints.lower, model.joints.upper)
        placed = placements(chain, dict(zip(model.joints.names, positions, strict=True)))
        for name, expected in zip(model.link_names, link_placements(model, positions), strict=True):
            assert placed[name] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("view", ["front", "top", "left", "free"])
def test_a_view_shows_the_workspace_and_not_much_more(robot, view):
    message, model = described(robot)
    camera = camera_of(appearance_of(message), view)
    assert camera.orthographic == (view != "free")
    random = np.random.default_rng(4)
    tools = [
        frame_placements(model, random.uniform(model.joints.lower, model.joints.upper))["tool"][:3, 3]
        for _ in range(500)
    ]
    above = np.array([tool for tool in tools if tool[2] > 0])
    shares = np.abs(pixels(camera, SIZE, above) / SIZE * 2 - 1)
    assert shares.max() < 1.0
    assert shares.max() > 0.75


def test_cameras_move_with_the_robots_base():
    base_to_site = np.array([[0.0, -1, 0, 5], [1, 0, 0, -2], [0, 0, 1, 0.4], [0, 0, 0, 1]])
    at_origin, moved = (appearance_of(described("pt600", at)[0]) for at in (None, base_to_site))
    home_at_origin, home_moved = home_placements(at_origin), home_placements(moved)
    for view in ("front", "top", "left", "free"):
        points = [
            pixels(camera_of(appearance, view), SIZE, np.array([home["wrist"][:3, 3]]))
            for appearance, home in ((at_origin, home_at_origin), (moved, home_moved))
        ]
        assert points[0] == pytest.approx(points[1], abs=1e-6)
    assert moved.center == pytest.approx(base_to_site[:3, :3] @ at_origin.center + base_to_site[:3, 3])


def test_a_view_of_the_description_replaces_the_default_free_view():
    message, _ = described("pt600")
    eye, target = Vector3(x=1.0, y=2.0, z=1.5), Vector3(z=0.4)
    message.views.add(name="free", eye=eye, target=target, up=Vector3(z=1.0), projection=View.PERSPECTIVE)
    camera = camera_of(appearance_of(message), "free")
    assert camera.eye == pytest.approx([1.0, 2.0, 1.5])
    with pytest.raises(UnknownViewError, match="no view 'behind'; there are close, free, front, left, top"):
        camera_of(appearance_of(message), "behind")


def test_a_moving_axis_reaches_to_its_limits():
    urdf = """<robot name="gantry"><link name="rail"/><link name="hand"/>
      <joint name="x" type="prismatic"><parent link="rail"/><child link="hand"/>
      <origin xyz="0 0 1" rpy="0 0 1.5707963267948966"/><axis xyz="1 0 0"/>
      <limit lower="-0.5" upper="2" effort="0" velocity="1"/></joint></robot>"""
    points = reach(read_chain(urdf), {"hand": np.array([[0.0, 0.0, -0.1]])})
    assert points.min(axis=0) == pytest.approx([0.0, -0.5, 0.0], abs=0.05)
    assert points.max(axis=0) == pytest.approx([0.0, 2.0, 1.0], abs=0.05)


@pytest.mark.parametrize(
    ("urdf", "says"),
    [
        ("", "cannot be read"),
        ("<robot><link name='a'/><link name='b'/></robot>", "2 root links"),
        ("<robot><link name='a'/><joint name='j' type='fixed'/></robot>", "has no parent"),
    ],
)
def test_a_urdf_that_is_not_a_chain_is_rejected(urdf, says):
    with pytest.raises(ChainError, match=says):
        appearance_of(Description(urdf=urdf))


def test_a_robot_with_rows_of_zeros_is_visible_in_every_view(tmp_path):
    """Check a new robot in Define, which has rows of zeros: it crashed the renderer."""
    (tmp_path / "robot.toml").write_text(
        'name = "new"\n[[joint]]\nname = "j"\na = 0.0\nalpha = 0.0\nd = 0.0\nlimits = [-180.0, 180.0]\n'
        "max_speed = 90.0\nmax_acceleration = 360.0\nmax_jerk = 3600.0\n"
    )
    message, _ = described(tmp_path / "robot.toml")
    appearance = appearance_of(message)
    assert appearance.radius >= 0.1
    for name in ("front", "top", "left", "free"):
        camera = camera_of(appearance, name)
        assert np.linalg.norm(camera.eye - camera.target) >= 0.1
