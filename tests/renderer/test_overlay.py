"""The overlay: texts, their positions, and digits of fixed width."""

import numpy as np
import pytest

from renderer.pictures.overlay import AMBER, Overlay, Row, inside, text_width, write_over

ROWS = (Row("waist", "−12.34", "°", 0.4), Row("lift", "1204.5", "mm", 1.0))
LIVE = Overlay(title="pt600", view="free", time="14:02:11.3 UTC", state="moving", rows=ROWS)


def written(overlay, size=(1280, 720)):
    picture = np.full((size[1], size[0], 3), 150, dtype=np.uint8)
    write_over(picture, overlay)
    return picture


def is_amber(picture):
    return (np.abs(picture.astype(int) - AMBER).max(axis=2) < 4).sum()


def test_digits_have_one_width():
    assert len({text_width(figure * 4, 18) for figure in "0123456789"}) == 1
    assert text_width("111.11", 18) == text_width("888.88", 18)


def test_a_live_picture_has_no_badge_and_a_stale_one_has():
    stale = Overlay(**{**LIVE.__dict__, "stale": "STALE 3 s"})
    assert is_amber(written(LIVE)) == 0
    assert is_amber(written(stale)) > 1000


@pytest.mark.parametrize("size", [(64, 64), (320, 180), (854, 480), (1920, 1080)])
def test_any_picture_size_is_possible(size):
    picture = written(
        Overlay(**{**LIVE.__dict__, "stale": "STALE 3 s", "marks": ("simulated", "replay")}), size
    )
    assert (picture != 150).any()


def test_the_centre_of_the_picture_has_no_text():
    assert (written(LIVE)[200:500, 400:900] == 150).all()


def test_other_values_do_not_move_the_rest():
    other = Overlay(**{**LIVE.__dict__, "rows": (Row("waist", "−98.76", "°", 0.4), ROWS[1])})
    changed = (written(LIVE) != written(other)).any(axis=2)
    rows, columns = np.nonzero(changed)
    assert rows.max() - rows.min() < 20
    assert columns.max() - columns.min() < text_width("−98.76", 19)


def test_a_camera_inside_a_body_is_marked():
    assert inside(LIVE, "forearm").marks == ("inside forearm",)
    assert inside(LIVE, "") is LIVE


def test_the_scale_is_in_the_lower_right_corner():
    changed = (written(Overlay(**{**LIVE.__dict__, "scale": "100 mm"})) != written(LIVE)).any(axis=2)
    rows, columns = np.nonzero(changed)
    assert (rows.min() > 640, columns.min() > 1080) == (True, True)
