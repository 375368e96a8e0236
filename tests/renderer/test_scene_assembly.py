"""Scenes of several robots, with ghosts, trails, fixtures and floor."""

import numpy as np
import pytest

from renderer.drawing.obstruction import contains, hides
from renderer.drawing.ribbons import ribbons
from renderer.scene.appearance import appearance_of, placements_at
from renderer.scene.assembly import Placed, scene_of
from renderer.scene.cameras import Camera, site_to_clip
from renderer.scene.scene import Finish, Line, square_m
from renderer.shapes.occlusion import open_sky
from renderer.shapes.prepare import prepared
from tests.renderer.bodies import ball, cube
from tests.renderer.test_appearance import described

FRONT = Camera(np.array([3.0, 0.0, 0.5]), np.array([0.0, 0.0, 0.5]), np.array([0.0, 0.0, 1.0]))


@pytest.fixture(scope="module")
def appearance():
    message, _ = described("pt600")
    for link in message.links:
        link.mesh = link.name
    fixture = message.fixtures.add(name="table", mesh="fixture.table")
    fixture.fixture_to_site[:] = np.eye(4).ravel()
    return appearance_of(message)


def test_the_drawn_floor_is_the_floor_of_the_collision_check():
    message, _ = described("pt600")
    message.ClearField("floor")
    message.base_to_site[:] = np.eye(4).ravel()
    message.base_to_site[11] = 0.4

    def floor():
        seen = appearance_of(message)
        return scene_of(Placed(seen, placements_at(seen, {}))).floor

    assert floor() == 0.4  # of an older publisher: at the robot's base
    message.floor.height = -0.25
    assert floor() == -0.25
    message.floor.ClearField("height")
    assert floor() is None


def test_robots_are_stale_independently_and_fixtures_with_the_viewed_robot(appearance):
    placed = placements_at(appearance, {})
    scene = scene_of(Placed(appearance, placed), Placed(appearance, placed, stale=True))
    assert {part.finish for part in scene.parts} == {Finish.PLAIN}
    assert {part.finish for part in scene.others} == {Finish.STALE}
    assert {part.finish for part in scene.fixtures} == {Finish.PLAIN}
    scene = scene_of(Placed(appearance, placed, stale=True, touching={"wrist"}))
    assert {part.finish for part in scene.parts + scene.fixtures} == {Finish.STALE}


def test_only_links_in_contact_are_red(appearance):
    scene = scene_of(Placed(appearance, placements_at(appearance, {}), touching={"wrist"}))
    assert [part.name for part in scene.parts if part.finish is Finish.RED] == ["wrist"]


def test_a_ghost_has_only_the_links_that_move(appearance):
    now, then = placements_at(appearance, {}), placements_at(appearance, {"elbow": 0.5})
    scene = scene_of(Placed(appearance, now), ghost=then)
    assert {part.finish for part in scene.others} == {Finish.GHOST}
    names = {part.name for part in scene.others}
    assert "forearm" in names
    assert not names & {"base", "column", "upper_arm"}


def test_a_trail_fades_and_axes_are_red_green_and_blue(appearance):
    trail = np.linspace([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 5)
    scene = scene_of(Placed(appearance, placements_at(appearance, {})), trail=trail, frames=True)
    first, *axes = scene.lines
    assert (first.opacity[0], np.diff(first.opacity).min() > 0) == (0.0, True)
    assert len(axes) == 3 * len(appearance.description.frames)
    assert [int(np.argmax(axis.color)) for axis in axes[:3]] == [0, 1, 2]
    one = scene_of(Placed(appearance, placements_at(appearance, {})), trail=trail[:1])
    assert one.lines == ()


@pytest.mark.parametrize(("radius", "expected"), [(0.05, 0.01), (0.9, 0.1), (1.4, 0.1), (6.0, 1.0)])
def test_a_square_of_the_floor_is_a_round_length(radius, expected):
    assert square_m(radius) == pytest.approx(expected)


def test_a_ribbon_has_its_width_and_ends_before_the_eye():
    size = (1280, 720)
    matrix = site_to_clip(FRONT, 16 / 9, center=FRONT.target, radius=4.0)
    points = np.array([[0.0, -0.2, 0.5], [0.0, 0.2, 0.5], [9.0, 0.2, 0.5]])
    corners = ribbons([Line(points, (1.0, 0.0, 0.0), np.ones(3), 6.0)], matrix, size)
    assert corners.shape == (6, 8)
    rows = corners[:, 1] / corners[:, 3] * 360
    assert np.ptp(rows) == pytest.approx(6.0, abs=0.01)
    assert ribbons([], matrix, size).shape == (0, 8)


def test_a_point_is_inside_a_body_or_not():
    mesh = prepared(ball(0.5))
    positions = mesh.positions.astype(np.float64)
    assert contains(positions, mesh.triangles, np.array([0.1, 0.2, -0.3]))
    assert not contains(positions, mesh.triangles, np.array([0.4, 0.4, 0.4]))
    # A body with a hole still has an inside.
    assert contains(positions, mesh.triangles[:-6], np.array([0.0, 0.0, 0.0]))


def box(middle, size):
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return np.array(middle) + corners * size


@pytest.mark.parametrize(
    ("corners", "expected"),
    [
        (box([1.2, 0.0, 0.5], [0.02, 1.8, 1.0]), True),  # a fence in front
        (box([-1.2, 0.0, 0.5], [0.02, 1.8, 1.0]), False),  # behind
        (box([1.2, 0.0, 0.5], [0.08, 0.08, 1.2]), False),  # a post
        (box([1.2, 2.5, 0.5], [0.02, 1.0, 1.0]), False),  # to the side
        (box([3.0, 0.0, 0.5], [0.5, 0.5, 0.5]), True),  # the camera is in it
        (box([5.0, 0.0, 0.5], [0.5, 5.0, 2.0]), False),  # behind the camera
    ],
)
def test_a_fixture_between_camera_and_arm_is_transparent(corners, expected):
    assert hides(FRONT, 16 / 9, corners, center=FRONT.target, radius=0.9) is expected


def test_a_hollow_vertex_sees_less_sky_than_an_exposed_one():
    mesh = prepared(cube(0.5))
    positions, normals = mesh.positions.astype(np.float64), mesh.normals.astype(np.float64)
    outside = open_sky(positions, normals, mesh.triangles)
    inside = open_sky(positions, -normals, mesh.triangles[:, ::-1])
    assert outside.min() > 0.9
    assert inside.max() < 0.75
    assert len(open_sky(np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 3), dtype=int))) == 0
