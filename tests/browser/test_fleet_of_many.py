"""Two hundred robots on one page: only visible tiles are subscribed and drawn."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.crowd import crowd
from tests.browser.robot_page import drawings, tile, tiles, until

pytestmark = [pytest.mark.long, pytest.mark.browser]

COUNT = 200
FIRST, LAST = "yard/r000", f"yard/r{COUNT - 1:03d}"


@pytest.fixture(scope="module")
def many(plant):
    """Yield robots of another site than the console's."""
    with crowd(plant.endpoint, ("yard",), COUNT) as held:
        yield held


def test_of_two_hundred_robots_only_the_tiles_in_sight_are_watched_and_drawn(open_page, many):
    page = open_page()
    expect(tiles(page)).to_have_count(COUNT + 2)
    expect(drawings(tile(page, FIRST))).to_have_attribute("data-drawn", re.compile("."))
    assert drawings(tiles(page)).count() < COUNT / 4
    until(page, lambda: FIRST in many.watched and len(many.watched) < COUNT / 4)
    tile(page, LAST).scroll_into_view_if_needed()
    expect(drawings(tile(page, LAST))).to_have_attribute("data-drawn", re.compile("."))
    expect(drawings(tile(page, FIRST))).to_have_count(0)
    until(page, lambda: LAST in many.watched and FIRST not in many.watched)
    expect(tile(page, LAST)).to_contain_text("slow link")
