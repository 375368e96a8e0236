"""Two hundred robots on one page: only visible tiles are subscribed and drawn."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.crowd import crowd
from tests.browser.robot_page import button, drawings, joint_value, region, serious, tile, tiles, until, visit

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


def test_what_needs_a_look_is_found_among_many_and_stands_first_when_asked(open_page, many):
    many.mark("faulty", [LAST])
    page = open_page(drawn=False)
    expect(page.get_by_role("list", name="Robots by state")).to_contain_text("1 Fault")
    page.get_by_label("Order").select_option(label="Most urgent first")
    yard = page.get_by_role("region", name="Site yard")
    expect(yard.get_by_role("link").first).to_have_attribute("data-robot", f"robomesh/{LAST}")
    expect(tile(page, LAST)).to_contain_text("axis 2: following error")
    page.get_by_label("State", exact=True).select_option(label="Faults and stops")
    expect(tiles(page)).to_have_count(1)
    page.get_by_label("Filter robots").fill("nowhere")
    expect(page.get_by_text(re.compile(r"^No robot matches the filter\. \d+ are on"))).to_be_visible()
    page.get_by_role("button", name="Clear the filter").click()
    expect(tiles(page)).to_have_count(COUNT + 2)
    many.mark("faulty", [])


def test_a_robot_that_is_only_watched_is_marked_and_offers_no_command(open_page, many):
    page = open_page("#/yard/r001", drawn=False)
    expect(button(page, "Take control")).to_be_visible()
    expect(button(page, "waist +1°")).to_be_visible()
    many.mark("read_only", ["yard/r001"])
    expect(region(page, "Control")).to_contain_text("reads this kind of controller")
    for name in ("Take control", "Home", "waist +1°"):
        expect(button(page, name)).to_have_count(0)
    assert serious(page) == []
    visit(page, "#/")
    expect(tile(page, "yard/r001")).to_contain_text("read-only")
    expect(tile(page, "yard/r002")).not_to_contain_text("read-only")
    many.mark("read_only", [])


def test_a_robot_of_another_site_is_shown_from_its_slow_states_until_all_is_asked_for(open_page, many):
    page = open_page("#/yard/r007", drawn=False)
    expect(joint_value(page, "waist")).to_have_text(re.compile(r"^−?\d"))
    expect(region(page, "Video").get_by_label("View", exact=True)).to_have_value("far")
    until(page, lambda: "yard/r007" in many.watched)
    page.get_by_role("button", name="All", exact=True).click()
    until(page, lambda: "yard/r007" not in many.watched)


def test_one_of_many_robots_is_found_by_typing_in_the_bar(open_page, many):
    page = open_page("#/yard/r007", drawn=False)
    page.get_by_role("button", name="r007").click()
    options = page.get_by_role("dialog", name="Go to a robot").get_by_role("option")
    expect(options).to_have_count(COUNT + 2)
    page.keyboard.type("yard 19")
    expect(options).to_have_count(12)  # r019, r119, r190 to r199
    page.keyboard.press("PageDown")
    page.keyboard.press("Enter")
    expect(page.get_by_role("heading", level=1)).to_have_text("r196")
