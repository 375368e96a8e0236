"""Views that somebody asks for: what is possible, what is refused in words, and who shares one."""

import math

import pytest

from renderer.appearance import look_of
from renderer.errors import RendererError
from renderer.requested_views import far, requested
from robomesh.schemas.robomesh_pb2 import Vector3, View, ViewRequest
from tests.renderer.test_look import described

SIZE = (1280, 720)


@pytest.fixture(scope="module")
def look():
    return look_of(described("pt600")[0])


def asked(look, **fields):
    return requested(ViewRequest(**fields), look, first="front", size=SIZE, fps=30.0)


def camera(**fields):
    view = {"eye": Vector3(x=2.0), "target": Vector3(z=0.5), "projection": View.PERSPECTIVE}
    return View(**{**view, **fields})


def test_what_is_not_said_is_as_the_renderer_s_own(look):
    shot = asked(look, of="top")
    assert (shot.of, shot.size, shot.fps, shot.image_hz, shot.most_bits_per_s) == (
        "top",
        SIZE,
        30.0,
        30.0,
        0.0,
    )
    assert shot.name.startswith("free-")
    assert shot.requested


def test_a_width_alone_keeps_the_shape_of_the_picture(look):
    assert asked(look, of="top", width=640).size == (640, 360)
    assert asked(look, of="top", height=480).size == (854, 480)


def test_who_asks_for_the_same_gets_the_same(look):
    one = asked(look, view=camera(name="mine"), width=640, height=360, fps=30.0)
    same = asked(look, view=camera(name="yours"), width=640, height=360)
    assert one.name == same.name
    others = [
        asked(look, view=camera(), width=642, height=360),
        asked(look, view=camera(), width=640, height=360, fps=29.0),
        asked(look, view=camera(eye=Vector3(x=2.1)), width=640, height=360),
        asked(look, view=camera(mount="tool"), width=640, height=360),
        asked(look, view=camera(), width=640, height=360, most_bits_per_s=1e6),
        asked(look, view=camera(), width=640, height=360, show=ViewRequest.Show(trail=True)),
        asked(look, of="front", width=640, height=360),
    ]
    assert len({one.name, *(other.name for other in others)}) == 8


def test_less_of_the_far_view_is_less_of_the_view_that_it_is_of(look):
    assert asked(look, of="far", width=320, height=180) == asked(look, of="front", width=320, height=180)


def test_the_far_view_is_small_and_of_few_bits():
    shot = far("front", size=SIZE, fps=30.0)
    assert (shot.name, shot.of, shot.size, shot.most_bits_per_s) == ("far", "front", (640, 360), 250e3)
    assert far("front", size=(320, 180), fps=5.0).size == (320, 180)
    assert far("front", size=(320, 180), fps=5.0).fps == 5.0


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({}, "needs one of `view`, a camera, and `of`"),
        ({"of": "front", "view": camera()}, "needs one of"),
        ({"of": "behind"}, "no view 'behind'; there are close, far, free, front, left, top"),
        ({"of": "front", "width": 4000, "height": 3000}, "4000 x 3000 pixels: even numbers from 64 to 1920"),
        ({"of": "front", "width": 641, "height": 360}, "641 x 360"),
        ({"of": "front", "width": 32, "height": 32}, "32 x 32"),
        ({"of": "front", "width": 1920, "height": 1920}, "as many pixels as 1920 x 1080"),
        ({"of": "front", "width": 2**32 - 2}, "even numbers from 64"),
        ({"of": "front", "fps": 61.0}, "fps 61: 1 to 60 is possible"),
        ({"of": "front", "fps": 0.1}, "fps 0.1: 1 to 60"),
        ({"of": "front", "fps": -1.0}, "fps -1: 1 to 60"),
        ({"of": "front", "most_bits_per_s": 10.0}, "most_bits_per_s 10: 50000 to 1e"),
        ({"view": camera(mount="nose")}, "mount 'nose' is no link or frame"),
        ({"view": camera(eye=Vector3(z=0.5))}, "eye and target are both at"),
        ({"view": camera(field_of_view=4.0)}, "field_of_view 4 rad"),
        ({"view": camera(eye=Vector3(x=math.inf))}, "eye"),
        ({"of": "front", "show": ViewRequest.Show(ghost=[0.0])}, "a ghost of 1 joint positions"),
        ({"of": "front", "show": ViewRequest.Show(ghost=[math.nan] * 5)}, "not finite"),
        ({"of": "front", "show": ViewRequest.Show(path=[Vector3()] * 5001)}, "5000 at most"),
    ],
)
def test_what_is_not_possible_is_refused_in_words(look, fields, says):
    with pytest.raises(RendererError) as caught:
        asked(look, **fields)
    assert says in str(caught.value)
