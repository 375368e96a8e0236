"""The Wall shows what a real renderer draws of a moving arm, at the size of its tile."""

import re

import av
import pytest
from playwright.sync_api import expect

from tests.browser.rendering import rendering
from tests.browser.robot_page import (
    ARM,
    fault,
    serious,
    state_word,
    take,
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
    with rendering(plant, tmp_path_factory.mktemp("meshes"), size=(640, 360), anti_aliasing=0):
        yield


def changes(page, place=".wall-tile"):
    """Wait until the picture changes; return its width."""
    before = page.evaluate(PIXELS, place)
    page.wait_for_function(f"([place, before]) => ({PIXELS})(place) !== before", arg=[place, before])
    return before.split()[0]


def test_what_is_chosen_stands_in_the_address_and_keys_go_from_tile_to_tile(open_page):
    page = open_page("#/wall", drawn=False)
    tiles = page.get_by_role("article")
    expect(tiles).to_have_count(2)
    page.get_by_role("button", name="Choose pictures").click()
    page.get_by_role("group", name="hall/pt600").get_by_role("button", name="Top").click()
    expect(tiles).to_have_count(3)
    page.get_by_role("button", name="Done").click()
    assert page.url.endswith("/wall/hall/arm/close/hall/pt600/close/hall/pt600/top")
    page.reload()
    expect(tiles).to_have_count(3)
    tiles.nth(0).focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    expect(tiles.nth(2)).to_be_focused()
    tiles.nth(2).get_by_role("button").click()
    expect(tiles).to_have_count(2)
    assert page.url.endswith("/wall/hall/arm/close/hall/pt600/close")
    tiles.nth(1).dblclick(position={"x": 40, "y": 40})
    expect(page.get_by_role("heading", level=1)).to_have_text("pt600")


@pytest.mark.long
def test_a_robot_that_there_is_not_is_said_so_and_a_picture_that_does_not_come_too(open_page):
    page = open_page("#/wall/hall/nobody/close/hall/arm/front", drawn=False)
    expect(page.get_by_role("article").nth(0)).to_contain_text("not on the mesh")
    expect(page.get_by_role("article").nth(1)).to_contain_text("Waiting for a picture")


@pytest.mark.long
def test_a_tile_gives_only_the_reason_of_its_state(open_page, plant):
    page = open_page("#/wall/hall/arm/close/hall/replay-gone/close", drawn=False)
    tile = page.get_by_role("article").nth(0)
    expect(page.get_by_role("article").nth(1)).to_contain_text("This replay has ended")
    with fault(plant, "fault"):
        expect(tile).to_have_accessible_name(re.compile("Fault$"))
        expect(tile.get_by_text("overheated")).to_be_visible()
    expect(tile).to_have_accessible_name(re.compile("Stopped$"))
    # The link's text, that it is connected, is no reason.
    expect(tile.get_by_text("The controller has stopped by itself", exact=True)).to_be_visible()
    page.evaluate("path => (location.hash = path)", ARM)
    take(page)
    page.get_by_role("button", name="Reset", exact=True).click()
    expect(state_word(page)).to_have_text("Idle")


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
