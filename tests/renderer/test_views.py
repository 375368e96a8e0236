"""Cameras that anybody may ask for: where they stand, what they hang on, and what is refused in words."""

import math

import numpy as np
import pytest

from renderer.appearance import frame_placements, look_of, placements_at
from renderer.cameras import pixels
from renderer.errors import CameraError, UnknownViewError
from renderer.views import camera_from, camera_of, view_names
from robomesh.schemas.robomesh_pb2 import Vector3, View
from tests.renderer.test_look import described

SIZE = (640, 360)


@pytest.fixture(scope="module")
def look():
    base_to_site = np.eye(4)
    base_to_site[:3, 3] = 1.0, 2.0, 0.0
    return look_of(described("pt600", base_to_site)[0])


def vector(x, y, z):
    return Vector3(x=x, y=y, z=z)


def test_eye_and_target_are_in_the_robots_base_frame(look):
    camera = camera_from(look, View(eye=vector(2, 0, 1), target=vector(0, 0, 0.5)))
    assert camera.eye == pytest.approx([3.0, 2.0, 1.0])
    assert camera.target == pytest.approx([1.0, 2.0, 0.5])
    assert not camera.orthographic


def test_a_camera_on_the_tool_moves_with_it(look):
    view = View(mount="tool", eye=vector(-0.3, 0, 0), target=vector(0, 0, 0.1), up=vector(0, 0, 1))
    for waist in (0.0, 0.7):
        placed = placements_at(look, {"waist": waist, "shoulder": 0.9})
        tool = frame_placements(look, placed)["tool"]
        camera = camera_from(look, view, placed)
        landed = pixels(camera, SIZE, (tool @ [0, 0, 0.1, 1])[None, :3])
        assert landed == pytest.approx(np.array([[320.0, 180.0]]))
        assert np.linalg.norm(camera.eye - tool[:3, 3]) == pytest.approx(0.3)


def test_a_link_is_a_mount_too_and_without_placements_it_is_at_home(look):
    view = View(mount="forearm", eye=vector(0, 0, 1), target=vector(0, 0, 0))
    home = {joint.name: joint.home for joint in look.description.joints}
    expected = camera_from(look, view, placements_at(look, home))
    assert camera_from(look, view).eye == pytest.approx(expected.eye)


def test_an_orthographic_view_shows_the_height_it_asks_for_or_the_whole_room(look):
    view = View(eye=vector(5, 0, 0.5), target=vector(0, 0, 0.5), projection=View.ORTHOGRAPHIC)
    room = look.room @ look.base_to_site[:3, :3].T + look.base_to_site[:3, 3]
    landed = pixels(camera_from(look, view), SIZE, room)
    assert (landed.min() >= 0, (landed <= SIZE).all()) == (True, True)
    view.height = 0.8
    assert camera_from(look, view).half_height == pytest.approx(0.4)


def test_a_picture_of_another_shape_shows_the_whole_room_too(look):
    room = look.room @ look.base_to_site[:3, :3].T + look.base_to_site[:3, 3]
    for size in ((400, 400), (300, 600)):
        landed = pixels(camera_of(look, "free", aspect=size[0] / size[1]), size, room)
        assert landed.min() >= 0
        assert (landed <= size).all()


@pytest.mark.parametrize(
    ("view", "says"),
    [
        (View(eye=vector(1, 0, 0), target=vector(1, 0, 0)), r"both at \(1, 0, 0\) m"),
        (View(eye=vector(math.nan, 0, 0)), r"eye \(nan, 0, 0\): numbers from -1000 to 1000"),
        (View(eye=vector(0, 0, 1), target=vector(0, math.inf, 0)), "target"),
        (View(eye=vector(0, 2e3, 0)), "1000 are possible"),
        (View(eye=vector(1, 0, 0), mount="nose"), "mount 'nose' is no link or frame.*tool"),
        (
            View(eye=vector(1, 0, 0), field_of_view=3.1),
            r"field_of_view 3.1 rad: 0.017 to 2.618 \(1° to 150°\)",
        ),
        (View(eye=vector(1, 0, 0), field_of_view=math.nan), "field_of_view nan"),
        (View(eye=vector(1, 0, 0), projection=View.ORTHOGRAPHIC, height=-1), "height -1 m: 0.001 to 1000"),
    ],
)
def test_a_camera_that_is_not_possible_is_refused_in_words(look, view, says):
    with pytest.raises(CameraError, match=says) as caught:
        camera_from(look, view)
    assert "\n" not in str(caught.value)


def test_an_unknown_view_is_refused_with_those_there_are(look):
    assert set(view_names(look)) == {"top", "front", "left", "free", "close"}
    with pytest.raises(UnknownViewError, match="no view 'behind'; there are close, free, front, left, top"):
        camera_of(look, "behind")
