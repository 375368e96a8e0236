"""The Wall shows what a real renderer draws of a moving arm, at the size of its tile."""

import re

import av
import pytest
from playwright.sync_api import expect

from tests.browser.rendering import rendering
from tests.browser.robot_page import (
    serious,
    video_picture,
)

pytestmark = pytest.mark.browser

PIXELS = """
(place) => { const c = document.querySelector(`${place} canvas`);
  const { data } = c.getContext('2d').getImageData(0, 0, c.width, c.height);
  let sum = 0; for (let i = 0; i < data.length; i += 4) sum = (sum * 31 + data[i]) % 1000003;
  return `${c.width} ${sum}` }
"""


@pytest.fixture(scope="module")
def rendered(plant, tmp_path_factory):
    """Yield the plant's moving arm, rendered."""
    with rendering(plant, tmp_path_factory.mktemp("meshes"), size=(640, 360), fps=10, anti_aliasing=0):
        yield


def changes(page, place=".wall-tile"):
    """Wait until the picture changes; return its width."""
    before = page.evaluate(PIXELS, place)
    page.wait_for_function(f"([place, before]) => ({PIXELS})(place) !== before", arg=[place, before])
    return before.split()[0]


@pytest.mark.long
def test_a_tile_asks_for_a_picture_of_its_size_which_moves_as_the_arm_does(open_page, rendered):
    page = open_page("#/wall/hall/pt600/close", width=400, height=700, drawn=False)
    expect(page.get_by_role("article").get_by_role("img")).to_have_attribute("data-drawn", "true")
    assert changes(page) in ("320", "480")
    page.get_by_role("article").get_by_role("link", name="pt600").click()
    expect(page).to_have_url(re.compile("#/hall/pt600$"))


def test_the_robot_page_shows_live_video_that_can_be_taken_home(open_page, rendered):
    page = open_page("#/hall/pt600", drawn=False)
    expect(video_picture(page)).to_have_attribute("data-drawn", "true")
    changes(page, ".camera")
    with page.expect_download() as still:
        page.get_by_role("button", name="Save still").click()
    with av.open(str(still.value.path())) as picture:
        assert next(picture.decode(video=0)).width == 640
    page.get_by_role("button", name="Save MP4").click()
    expect(page.get_by_role("button", name="End MP4")).to_contain_text(re.compile(r":0[1-9]"))
    with page.expect_download() as saved:
        page.get_by_role("button", name="End MP4").click()
    assert saved.value.suggested_filename.startswith("pt600-front-")
    with av.open(str(saved.value.path()), format="mp4") as video:
        assert sum(1 for _ in video.decode(video=0)) > 0


def test_the_wall_never_scrolls_sideways_and_axe_finds_nothing_serious(open_page):
    page = open_page("#/wall", drawn=False)
    expect(page.get_by_role("article")).to_have_count(2)
    page.get_by_role("button", name="Choose pictures").click()
    for width in (1440, 768, 360):
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
    assert serious(page) == []
