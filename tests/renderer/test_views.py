"""Cameras of requested views: poses, mounts, and errors."""

import math

import numpy as np
import pytest

from renderer.errors import CameraError, UnknownViewError
from renderer.scene.appearance import appearance_of, frame_placements, placements_at
from renderer.scene.cameras import pixels
from renderer.scene.views import camera_from, camera_of, view_names
from robomesh.schemas.robomesh_pb2 import Vector3, View
from tests.renderer.test_appearance import described

SIZE = (640, 360)


@pytest.fixture(scope="module")
def appearance():
    base_to_site = np.eye(4)
    base_to_site[:3, 3] = 1.0, 2.0, 0.0
    return appearance_of(described("pt600", base_to_site)[0])


def vector(x, y, z):
    return Vector3(x=x, y=y, z=z)


def test_eye_and_target_are_in_the_robots_base_frame(appearance):
    camera = camera_from(appearance, View(eye=vector(2, 0, 1), target=vector(0, 0, 0.5)))
    assert camera.eye == pytest.approx([3.0, 2.0, 1.0])
    assert camera.target == pytest.approx([1.0, 2.0, 0.5])
    assert not camera.orthographic


def test_a_camera_on_the_tool_moves_with_it(appearance):
    view = View(mount="tool", eye=vector(-0.3, 0, 0), target=vector(0, 0, 0.1), up=vector(0, 0, 1))
    for waist in (0.0, 0.7):
        placed = placements_at(appearance, {"waist": waist, "shoulder": 0.9})
        tool = frame_placements(appearance, placed)["tool"]
        camera = camera_from(appearance, view, placed)
        landed = pixels(camera, SIZE, (tool @ [0, 0, 0.1, 1])[None, :3])
        assert landed == pytest.approx(np.array([[320.0, 180.0]]))
        assert np.linalg.norm(camera.eye - tool[:3, 3]) == pytest.approx(0.3)


def test_a_link_can_be_a_mount_and_is_at_home_without_placements(appearance):
    view = View(mount="forearm", eye=vector(0, 0, 1), target=vector(0, 0, 0))
    home = {joint.name: joint.home for joint in appearance.description.joints}
    expected = camera_from(appearance, view, placements_at(appearance, home))
    assert camera_from(appearance, view).eye == pytest.approx(expected.eye)


def test_an_orthographic_view_shows_its_height_or_the_whole_workspace(appearance):
    view = View(eye=vector(5, 0, 0.5), target=vector(0, 0, 0.5), projection=View.ORTHOGRAPHIC)
    workspace = appearance.workspace @ appearance.base_to_site[:3, :3].T + appearance.base_to_site[:3, 3]
    landed = pixels(camera_from(appearance, view), SIZE, workspace)
    assert (landed.min() >= 0, (landed <= SIZE).all()) == (True, True)
    view.height = 0.8
    assert camera_from(appearance, view).half_height == pytest.approx(0.4)


def test_a_picture_of_another_aspect_shows_the_whole_workspace(appearance):
    workspace = appearance.workspace @ appearance.base_to_site[:3, :3].T + appearance.base_to_site[:3, 3]
    for size in ((400, 400), (300, 600)):
        landed = pixels(camera_of(appearance, "free", aspect=size[0] / size[1]), size, workspace)
        assert landed.min() >= 0
        assert (landed <= size).all()


@pytest.mark.parametrize(
    ("view", "says"),
    [
        (View(eye=vector(1, 0, 0), target=vector(1, 0, 0)), r"both at \(1, 0, 0\) m"),
        (View(eye=vector(math.nan, 0, 0)), r"eye \(nan, 0, 0\): numbers must be from -1000 to 1000"),
        (View(eye=vector(0, 0, 1), target=vector(0, math.inf, 0)), "target"),
        (View(eye=vector(0, 2e3, 0)), "to 1000"),
        (View(eye=vector(1, 0, 0), mount="nose"), "mount 'nose' is not a link or frame.*tool"),
        (
            View(eye=vector(1, 0, 0), field_of_view=3.1),
            r"field_of_view 3.1 rad: must be from 0.017 to 2.618 \(1° to 150°\)",
        ),
        (View(eye=vector(1, 0, 0), field_of_view=math.nan), "field_of_view nan"),
        (
            View(eye=vector(1, 0, 0), projection=View.ORTHOGRAPHIC, height=-1),
            "height -1 m: must be from 0.001 to 1000",
        ),
    ],
)
def test_an_invalid_camera_is_rejected(appearance, view, says):
    with pytest.raises(CameraError, match=says) as caught:
        camera_from(appearance, view)
    assert "\n" not in str(caught.value)


def test_an_unknown_view_is_rejected_with_the_known_names(appearance):
    assert set(view_names(appearance)) == {"top", "front", "left", "free", "close"}
    with pytest.raises(UnknownViewError, match="no view 'behind'; there are close, free, front, left, top"):
        camera_of(appearance, "behind")
