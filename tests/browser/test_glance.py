"""The page at a glance: first screen of a phone, touch targets, the bar of every page."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.robot_page import (
    ARM,
    PAGES,
    alarms,
    button,
    joint_value,
    joint_values,
    region,
    state_word,
    stop_button,
    take,
    visit,
)

pytestmark = pytest.mark.browser

# Buttons, links and fields that a finger would miss. A link in a sentence is as high as its line; a box
# is as large as its label.
SMALL = """() => [...document.querySelectorAll(
    "a[href], button, select, summary, textarea, input:not([type=file]), [role=slider]")]
  .filter(each => each.checkVisibility({visibilityProperty: true}) && !each.matches(".skip-link"))
  .filter(each => !(each.matches("p a") && each.parentElement.textContent !== each.textContent))
  .map(each => [each, (each.closest("label") ?? each).getBoundingClientRect()])
  .filter(([, box]) => box.width > 1 && (box.width < 44 || box.height < 44))
  .map(([each, box]) => `${each.outerHTML.slice(0, 90)} ${box.width} x ${box.height}`)"""
NAMES = ["Fleet", "Wall", "Recordings", "Events", "New robot", "Settings"]


def page_links(page):
    return page.get_by_role("banner").get_by_role("navigation", name="Pages").get_by_role("link")


def box_of(place):
    expect(place).to_be_visible()
    return place.bounding_box()


def bottom_of(place):
    box = box_of(place)
    return box["y"] + box["height"]


@pytest.mark.parametrize(("width", "height"), [(360, 740), (768, 1024)])
def test_every_touch_target_of_every_page_is_large_enough_for_a_finger(open_page, raised, width, height):
    raised("joints.gone", "no positions come from it")
    page = open_page("", width, height, has_touch=True, drawn=False, refused=True)
    found = {}
    for path in PAGES:
        visit(page, path)
        if path == "#/events":
            expect(alarms(page)).not_to_have_count(0)
        found[path] = page.evaluate(SMALL)
        assert page.evaluate("document.documentElement.scrollWidth") == width
    visit(page, ARM)
    take(page)
    found["in control"] = page.evaluate(SMALL)
    button(page, "Release").click()
    assert found == {path: [] for path in found}


def test_the_first_screen_of_a_phone_has_picture_state_stop_and_joints(open_page):
    page = open_page(ARM, 360, 740, has_touch=True, drawn=False)
    expect(joint_values(page)).to_have_count(5)
    stop = box_of(stop_button(page))["y"]
    for shown in (region(page, "3-D view"), state_word(page), joint_value(page, "roll")):
        assert bottom_of(shown) <= stop
    control = box_of(region(page, "Control"))
    assert control["height"] <= 64
    take(page)
    assert box_of(region(page, "Control"))["height"] > control["height"]
    for name in ("Home", "Hold", "waist +1°"):
        expect(button(page, name)).to_be_visible()
    button(page, "Release").click()
    expect(button(page, "waist +1°")).to_be_hidden()
    assert box_of(region(page, "Control"))["height"] >= control["height"]


def test_the_first_screen_at_200_percent_shows_the_robot(open_page):
    page = open_page(ARM, 720, 450, device_scale_factor=2, drawn=False)
    expect(joint_values(page)).to_have_count(5)
    picture, stop = box_of(region(page, "3-D view")), box_of(stop_button(page))
    assert picture["height"] >= 200
    assert picture["y"] + picture["height"] <= stop["y"]
    assert bottom_of(joint_value(page, "shoulder")) <= stop["y"]


@pytest.mark.long
def test_every_page_has_the_same_bar(open_page):
    page = open_page(drawn=False, refused=True)
    bars = []
    for path in PAGES:
        visit(page, path)
        links = page_links(page)
        expect(links).to_have_text(NAMES)
        bars.append([each.bounding_box() for each in links.all()])
    assert all(bar == bars[0] for bar in bars)
    page.set_viewport_size({"width": 360, "height": 740})
    for path in ("#/wall", ARM):
        visit(page, path)
        page.get_by_label(re.compile("^Pages")).filter(visible=True).click()
        expect(page_links(page)).to_have_text(NAMES)
        page.keyboard.press("Escape")
        expect(page_links(page)).to_have_count(0)
