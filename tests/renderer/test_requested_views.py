"""Requested views: limits, errors, and sharing."""

import math

import pytest

from renderer.errors import RendererError
from renderer.pictures.requested_views import low_rate_view, requested_view
from renderer.scene.appearance import appearance_of
from robomesh.schemas.robomesh_pb2 import Vector3, View, ViewRequest
from tests.renderer.test_appearance import described

SIZE = (1280, 720)


@pytest.fixture(scope="module")
def appearance():
    return appearance_of(described("pt600")[0])


def asked(appearance, **fields):
    return requested_view(ViewRequest(**fields), appearance, first="front", size=SIZE, fps=30.0)


def camera(**fields):
    view = {"eye": Vector3(x=2.0), "target": Vector3(z=0.5), "projection": View.PERSPECTIVE}
    return View(**{**view, **fields})


def test_missing_fields_have_the_renderers_defaults(appearance):
    spec = asked(appearance, of="top")
    assert (spec.of, spec.size, spec.fps, spec.image_hz, spec.most_bits_per_s) == (
        "top",
        SIZE,
        30.0,
        30.0,
        0.0,
    )
    assert spec.name.startswith("free-")
    assert spec.requested


def test_a_width_without_height_keeps_the_aspect(appearance):
    assert asked(appearance, of="top", width=640).size == (640, 360)
    assert asked(appearance, of="top", height=480).size == (854, 480)


def test_equal_requests_share_one_view(appearance):
    one = asked(appearance, view=camera(name="mine"), width=640, height=360, fps=30.0)
    same = asked(appearance, view=camera(name="yours"), width=640, height=360)
    assert one.name == same.name
    others = [
        asked(appearance, view=camera(), width=642, height=360),
        asked(appearance, view=camera(), width=640, height=360, fps=29.0),
        asked(appearance, view=camera(eye=Vector3(x=2.1)), width=640, height=360),
        asked(appearance, view=camera(mount="tool"), width=640, height=360),
        asked(appearance, view=camera(), width=640, height=360, most_bits_per_s=1e6),
        asked(appearance, view=camera(), width=640, height=360, show=ViewRequest.Show(trail=True)),
        asked(appearance, of="front", width=640, height=360),
    ]
    assert len({one.name, *(other.name for other in others)}) == 8


def test_a_request_of_the_far_view_uses_its_camera(appearance):
    assert asked(appearance, of="far", width=320, height=180) == asked(
        appearance, of="front", width=320, height=180
    )


def test_the_far_view_is_small_and_has_a_low_bit_rate():
    spec = low_rate_view("front", size=SIZE, fps=30.0)
    assert (spec.name, spec.of, spec.size, spec.most_bits_per_s) == ("far", "front", (640, 360), 250e3)
    assert low_rate_view("front", size=(320, 180), fps=5.0).size == (320, 180)
    assert low_rate_view("front", size=(320, 180), fps=5.0).fps == 5.0


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({}, "needs either `view`, a camera, or `of`"),
        ({"of": "front", "view": camera()}, "needs either"),
        ({"of": "behind"}, "no view 'behind'; there are close, far, free, front, left, top"),
        ({"of": "front", "width": 4000, "height": 3000}, "4000 x 3000: must be even numbers from 64 to 1920"),
        ({"of": "front", "width": 641, "height": 360}, "641 x 360"),
        ({"of": "front", "width": 32, "height": 32}, "32 x 32"),
        ({"of": "front", "width": 1920, "height": 1920}, "as many pixels as 1920 x 1080"),
        ({"of": "front", "width": 2**32 - 2}, "even numbers from 64"),
        ({"of": "front", "fps": 61.0}, "fps 61: must be from 1 to 60"),
        ({"of": "front", "fps": 0.1}, "fps 0.1: must be from 1 to 60"),
        ({"of": "front", "fps": -1.0}, "fps -1: must be from 1 to 60"),
        ({"of": "front", "most_bits_per_s": 10.0}, "most_bits_per_s 10: must be from 50000 to 1e"),
        ({"view": camera(mount="nose")}, "mount 'nose' is not a link or frame"),
        ({"view": camera(eye=Vector3(z=0.5))}, "eye and target are both at"),
        ({"view": camera(field_of_view=4.0)}, "field_of_view 4 rad"),
        ({"view": camera(eye=Vector3(x=math.inf))}, "eye"),
        ({"of": "front", "show": ViewRequest.Show(ghost=[0.0])}, "the ghost has 1 joint positions"),
        ({"of": "front", "show": ViewRequest.Show(ghost=[math.nan] * 5)}, "not finite"),
        ({"of": "front", "show": ViewRequest.Show(path=[Vector3()] * 5001)}, "at most 5000"),
    ],
)
def test_invalid_requests_are_rejected(appearance, fields, says):
    with pytest.raises(RendererError) as caught:
        asked(appearance, **fields)
    assert says in str(caught.value)
