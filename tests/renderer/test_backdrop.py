"""How often backdrops are drawn."""

import numpy as np
import pytest

from renderer.drawing import backdrop
from renderer.drawing.drawing import Drawing
from renderer.scene.cameras import Camera
from renderer.scene.scene import Scene
from tests.renderer.bodies import context_or_skip

SIZE = (64, 36)
CENTER = np.array([0.0, 0.0, 0.2])
SCENE = Scene((), CENTER, 0.6)
PLACES = 12


def camera(number):
    """Return one of a thousand cameras around the scene."""
    angle = number * 2.0 * np.pi / 1000
    return Camera(
        CENTER + np.array([1.8 * np.cos(angle), 1.8 * np.sin(angle), 0.8]), CENTER, np.array([0.0, 0.0, 1.0])
    )


@pytest.fixture
def drawn(monkeypatch):
    """A function that draws cameras in turn, and returns how many backdrops were drawn for them."""
    monkeypatch.setattr(backdrop, "_MOST_BYTES", PLACES * SIZE[0] * SIZE[1] * 4)
    monkeypatch.setattr(backdrop, "_UNUSED_S", 1000.0)
    draw, drawn = backdrop.Backdrops._draw, []

    def count(*arguments):
        drawn.append(1)
        draw(*arguments)

    monkeypatch.setattr(backdrop.Backdrops, "_draw", count)
    drawing = Drawing(context_or_skip(), SIZE, samples=0)

    def run(numbers):
        drawn.clear()
        for number in numbers:
            drawing.draw(SCENE, camera(number))
        return len(drawn)

    yield run
    drawing.close()


def test_views_that_take_turns_draw_their_backdrops_twice_and_then_never(drawn):
    assert drawn([*range(PLACES)] * 2) == 2 * PLACES
    assert drawn([*range(PLACES)] * 5) == 0


def test_more_views_than_places_do_not_push_each_other_out(drawn):
    several = range(PLACES + 4)
    drawn([*several] * 3)
    assert drawn(several) == 4


def test_a_moving_camera_takes_no_place(drawn):
    fixed = range(PLACES)
    drawn([*fixed] * 2)
    assert drawn(range(100, 300)) == 200
    assert drawn(fixed) == 0


def test_a_backdrop_that_is_no_longer_used_gives_up_its_place(drawn, monkeypatch):
    before, after = range(PLACES), range(500, 500 + PLACES)
    drawn([*before] * 2)
    monkeypatch.setattr(backdrop, "_UNUSED_S", 0.0)
    drawn([*after] * 2)
    monkeypatch.setattr(backdrop, "_UNUSED_S", 1000.0)
    assert drawn(after) == 0
    assert drawn(before) == PLACES


def test_a_backdrop_that_is_not_kept_looks_like_a_kept_one():
    drawing = Drawing(context_or_skip(), SIZE, samples=0)
    others = [drawing.draw(SCENE, camera(number)) for number in (31, 77)]
    once, *again = [drawing.draw(SCENE, camera(0)) for _ in range(3)]
    assert all((once == each).all() for each in again)
    assert all((once != each).any() for each in others)
    drawing.close()
