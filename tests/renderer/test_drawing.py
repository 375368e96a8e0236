"""Drawing with real OpenGL: colours, occlusion, shadows, transparency."""

from dataclasses import replace

import numpy as np
import pytest

from renderer.drawing import opengl
from renderer.drawing.drawing import Drawing
from renderer.drawing.opengl import open_context
from renderer.errors import NoOpenGLError
from renderer.scene.cameras import Camera, pixels
from renderer.scene.scene import Finish, Line, Part, Scene
from renderer.shapes.prepare import prepared
from tests.renderer.bodies import ball, context_or_skip, cube

SIZE = (320, 180)
CENTER = np.array([0.0, 0.0, 0.2])
FREE = Camera(np.array([1.2, -1.5, 1.0]), CENTER, np.array([0.0, 0.0, 1.0]))
TOP = Camera(np.array([0.0, 0.0, 3.0]), CENTER, np.array([0.0, 1.0, 0.0]), half_height=0.6)
FRONT = Camera(np.array([3.0, 0.0, 0.2]), CENTER, np.array([0.0, 0.0, 1.0]), half_height=0.6)
RED, GREEN = (1.0, 0.0, 0.0, 1.0), (0.0, 0.6, 0.0, 1.0)


def at(x, y, z):
    placement = np.eye(4)
    placement[:3, 3] = x, y, z
    return placement


def scene(*parts):
    return Scene(tuple(parts), CENTER, 0.6)


@pytest.fixture(scope="module")
def drawing():
    drawing = Drawing(context_or_skip(), SIZE)
    drawing.add("red", prepared(cube(0.1, color=RED)))
    drawing.add("green", prepared(cube(0.1, color=GREEN)))
    drawing.add("ball", prepared(ball(0.15, color=RED)))
    drawing.add("glass", prepared(cube(0.1, color=(0.0, 0.0, 1.0, 0.4))))
    yield drawing
    drawing.close()


def is_red(pixel):
    red, green, blue = (int(value) for value in pixel)
    return red > 90 and red > 2 * green and red > 2 * blue


def pixel_at(picture, camera, point):
    (x, y), *_ = pixels(camera, SIZE, np.array([point]))
    return picture[int(y), int(x)]


@pytest.mark.parametrize("camera", [FREE, TOP, FRONT])
@pytest.mark.slow
def test_a_red_cube_is_red_where_the_camera_looks(drawing, camera):
    picture = drawing.draw(scene(Part("red", at(0, 0, 0.2))), camera)
    assert picture.shape == (180, 320, 3)
    assert is_red(picture[90, 160])
    assert not is_red(picture[4, 4])


def test_a_top_view_puts_a_cube_where_the_matrix_says(drawing):
    picture = drawing.draw(scene(Part("red", at(0.4, 0.2, 0.1))), TOP)
    red = picture[..., 0].astype(int) - picture[..., 1].astype(int) > 80
    rows, columns = np.nonzero(red)
    corners = np.array([[0.3, 0.3, 0.2], [0.5, 0.1, 0.2]])
    expected = pixels(TOP, SIZE, corners)
    assert (columns.min(), rows.min()) == pytest.approx(expected[0], abs=1.5)
    assert (columns.max() + 1, rows.max() + 1) == pytest.approx(expected[1], abs=1.5)


def test_the_nearer_body_hides_the_farther(drawing):
    parts = Part("green", at(0, 0, 0.2)), Part("red", at(0.4, 0, 0.2))
    for order in (parts, parts[::-1]):
        assert is_red(drawing.draw(scene(*order), FRONT)[90, 160])


def test_bodies_behind_glass_are_visible(drawing):
    behind = drawing.draw(scene(Part("red", at(0, 0, 0.2))), FRONT)[90, 160].astype(int)
    through = drawing.draw(scene(Part("glass", at(0.4, 0, 0.2)), Part("red", at(0, 0, 0.2))), FRONT)
    red, _, blue = through[90, 160].astype(int) - behind
    assert red < -10
    assert blue > 10


def test_a_stale_picture_is_grey(drawing):
    part = Part("red", at(0, 0, 0.2))
    live = drawing.draw(scene(part), FREE)[90, 160].astype(int)
    stale = drawing.draw(scene(replace(part, finish=Finish.STALE)), FREE)[90, 160].astype(int)
    assert np.ptp(live) > 100
    assert np.ptp(stale) < 30


def test_a_body_casts_its_shadow_on_the_floor_below_it(drawing):
    empty = drawing.draw(scene(), TOP).astype(int)
    hovering = drawing.draw(scene(Part("red", at(0, 0, 0.1))), TOP).astype(int)
    dark = (empty - hovering).min(axis=2)
    # The cube extends 15 px to each side of the centre.
    assert dark[85:95, 160 - 22 : 160 - 16].max() > 15
    assert dark[90, 4] == 0


def test_the_floor_is_drawn_at_its_height_or_not_at_all(drawing):
    def seen(floor):
        return drawing.draw(replace(scene(), floor=floor), FREE).astype(int)

    none = seen(None)
    # Without a floor there is only the backdrop, which is constant from left to right.
    assert np.ptp(none, axis=1).max() <= 3
    assert np.ptp(seen(0.0), axis=1).max() > 10
    # Seen from a height of 1 m, a lower floor looks different.
    assert np.abs(seen(-0.25) - seen(0.0)).max() > 10
    body = scene(Part("red", at(0, 0, 0.2)))
    assert is_red(drawing.draw(replace(body, floor=None), FREE)[90, 160])


@pytest.mark.slow
def test_edges_are_smooth_with_samples_and_stepped_without(drawing):
    rough = Drawing(context_or_skip(), SIZE, samples=0)
    rough.add("ball", prepared(ball(0.15, color=RED)))
    shades = []
    for each in (drawing, rough):
        column = each.draw(scene(Part("ball", at(0, 0, 0.2))), TOP)[60:120, 160:220].astype(int)
        redness = column[..., 0] - column[..., 1]
        shades.append(((redness > 15) & (redness < 70)).sum())
    rough.close()
    assert shades[0] > shades[1]


def test_bodies_next_to_the_camera_or_out_of_sight_are_harmless(drawing):
    parts = Part("red", at(0, 0, 0.2)), Part("green", at(1.2, -1.5, 1.0)), Part("green", at(9, 9, 9))
    drawing.draw(scene(*parts), FREE)
    picture = drawing.draw(scene(Part("green", at(9, 9, 9))), TOP)
    assert not is_red(picture[90, 160])


def test_a_released_or_unknown_shape_is_not_drawn(drawing):
    drawing.add("passing", prepared(cube(0.1, color=RED)))
    drawing.forget(["passing"])
    picture = drawing.draw(scene(Part("passing", at(0, 0, 0.2)), Part("never", at(0, 0, 0.2))), FRONT)
    assert not is_red(picture[90, 160])


@pytest.mark.slow
def test_an_unknown_device_is_rejected_in_one_line():
    context_or_skip().release()
    with pytest.raises(NoOpenGLError, match=r"EGL device 99 cannot be used .*there is 0: ") as caught:
        open_context(device=99)
    assert "\n" not in str(caught.value)


class Context:
    def __init__(self, name):
        self.info = {"GL_RENDERER": name}

    def release(self):
        pass


@pytest.mark.parametrize(
    ("devices", "best"),
    [
        (["NVIDIA H100", "llvmpipe (LLVM 15)"], 0),
        (["llvmpipe (LLVM 15)", "NVIDIA H100"], 1),
        (["", "llvmpipe (LLVM 15)"], 1),
        (["", ""], 0),
    ],
)
def test_the_first_gpu_that_works_is_preferred_to_software(devices, best, monkeypatch, caplog):
    def open_device(number):
        if not devices[number]:
            raise opengl._CannotOpenError("eglInitialize failed (0x3001)")
        return Context(devices[number])

    monkeypatch.setattr(opengl, "_device_count", lambda: len(devices))
    monkeypatch.setattr(opengl, "_open", open_device)
    assert opengl._best_device.__wrapped__() == best
    unusable = [line for line in caplog.messages if "eglInitialize failed" in line]
    assert len(unusable) == devices.count("")
    assert [name.endswith(", in software") for name in opengl.device_names()] == [
        name.startswith("llvmpipe") for name in devices
    ]


def test_a_ghost_is_blue_and_transparent(drawing):
    red = Part("red", at(0, 0, 0.2))
    ghost = replace(red, part_to_site=at(0.4, 0, 0.2), finish=Finish.GHOST)
    alone = drawing.draw(scene(red), FRONT)[90, 160].astype(int)
    seen = drawing.draw(replace(scene(red), others=(ghost,)), FRONT)[90, 160].astype(int)
    assert seen[2] > alone[2] + 40
    assert seen[0] > 60


def test_a_line_is_hidden_by_bodies_in_front_of_it_only(drawing):
    cube_there = scene(Part("red", at(0, 0, 0.2)))
    for x, shown in ((0.3, True), (-0.3, False)):
        points = np.array([[x, -0.05, 0.2], [x, 0.05, 0.2]])
        lines = (Line(points, (0.0, 0.2, 1.0), np.ones(2), 12.0),)
        pixel = drawing.draw(replace(cube_there, lines=lines), FRONT)[90, 160].astype(int)
        assert bool(pixel[2] > pixel[0]) is shown


def test_a_fence_is_transparent_in_front_of_the_arm_and_opaque_behind_it(drawing):
    drawing.add("fence", prepared(cube(0.45, color=GREEN)))
    arm = scene(Part("red", at(0, 0, 0.2)))
    before = replace(arm, fixtures=(Part("fence", at(1.2, 0, 0.2)),))
    assert is_red(drawing.draw(before, FRONT)[90, 160])
    behind = drawing.draw(replace(arm, fixtures=(Part("fence", at(-1.2, 0, 0.2)),)), FRONT)
    red, green, _ = behind[60, 130].astype(int)
    assert green > 60
    assert red < 40


def test_a_camera_inside_a_body_draws_and_names_the_body(drawing):
    inside = replace(FREE, eye=np.array([0.02, 0.0, 0.2]), target=np.array([1.0, 0.0, 0.2]))
    there = scene(Part("ball", at(0, 0, 0.2), name="forearm"))
    assert drawing.inside(there, inside) == "forearm"
    assert drawing.inside(there, FREE) == ""
    assert drawing.inside(there, TOP) == ""
    assert drawing.draw(there, inside).std() > 0


@pytest.mark.slow
def test_full_shading_casts_a_body_shadow_on_another():
    lit = Drawing(context_or_skip(), SIZE, shading="full")
    try:
        lit.add("table", prepared(cube(0.3, color=(0.8, 0.8, 0.8, 1.0))))
        lit.add("ball", prepared(ball(0.08, color=RED)))
        table = Part("table", at(0, 0, 0.0))
        alone = lit.draw(scene(table), TOP).astype(int)
        below = lit.draw(scene(table, Part("ball", at(0.0, 0.0, 0.6))), TOP).astype(int)
        darker = (alone - below).min(axis=2)
        # The lamp is at positive x and y: the ball's shadow is next to it, on the table.
        assert darker[95:150, 85:155].max() > 30
        assert darker[50:80, 180:230].max() < 8
    finally:
        lit.close()


@pytest.mark.slow
def test_an_unknown_shading_is_rejected():
    with pytest.raises(ValueError, match="'dim' is not a valid Shading"):
        Drawing(context_or_skip(), SIZE, shading="dim")
