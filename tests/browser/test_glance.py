"""The page at a glance: first screen of a phone, touch targets, the bar of every page, choice of a robot."""

import re

import pytest
from playwright.sync_api import expect

from robomesh.contract.keys import WHOLE_SITE
from tests.browser.rendering import rendering
from tests.browser.robot_page import (
    ARM,
    PAGES,
    button,
    joint_value,
    joint_values,
    region,
    scene,
    scene_stale,
    state_word,
    stop_button,
    take,
    tiles,
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
def test_every_touch_target_of_every_page_is_large_enough_for_a_finger(open_page, width, height):
    page = open_page("", width, height, has_touch=True, drawn=False, refused=True)
    found = {}
    for path in PAGES:
        visit(page, path)
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


def test_the_bar_leads_to_another_robot_by_a_few_letters(open_page):
    page = open_page(ARM, drawn=False)
    page.get_by_role("button", name="arm Choose another robot").click()
    options = page.get_by_role("dialog", name="Go to a robot").get_by_role("option")
    expect(options).to_have_text([re.compile("^arm"), re.compile("^pt600")])
    expect(options.nth(1)).to_contain_text(re.compile("Moving|Idle"))
    page.keyboard.press("ArrowDown")
    expect(options.nth(1)).to_have_attribute("aria-selected", "true")
    page.keyboard.press("Escape")
    expect(options).to_have_count(0)
    page.keyboard.press("Enter")  # the focus is at the button again
    page.keyboard.type("hall pt")
    expect(options).to_have_count(1)
    page.keyboard.press("Enter")
    expect(page.get_by_role("heading", level=1)).to_have_text("pt600")
    # A program's page leads to the other robot's program.
    visit(page, "#/program/hall/arm")
    page.get_by_role("button", name="arm Choose another robot").click()
    page.keyboard.type("pt6")
    page.keyboard.press("Enter")
    expect(page).to_have_url(re.compile("#/program/hall/pt600$"))


@pytest.mark.long
def test_a_robot_that_does_not_exist_is_said_at_once_without_any_control_before(open_page):
    page = open_page(drawn=False)
    expect(tiles(page).first).to_be_visible()
    # Everything that the page shows from now on.
    page.evaluate(
        """() => { window.seen = new Set();
        new MutationObserver(() => {
            for (const name of [".control", ".step", ".scene", ".looking", ".missing h1"])
                if (document.querySelector(name)) window.seen.add(name);
        }).observe(document, {childList: true, subtree: true}); }"""
    )
    page.evaluate("location.hash = '#/hall/nowhere'")
    expect(page.get_by_role("heading", level=1)).to_have_text("There is no robot nowhere at hall.")
    page.evaluate("location.hash = '#/program/hall/nowhere'")
    expect(page.get_by_role("heading", level=1)).to_have_text("There is no robot nowhere at hall.")
    assert page.evaluate("[...window.seen]") == [".missing h1"]
    visit(page, ARM)
    expect(region(page, "Control")).to_be_visible()


@pytest.mark.long
def test_the_last_still_is_shown_until_the_3_d_view_can_draw_and_looks_neither_live_nor_stale(
    open_page, plant, tmp_path
):
    with rendering(plant, tmp_path):
        plant.session.declare_presence("hall", WHOLE_SITE, "renderer")
        page = open_page(drawn=True)
        held, open_gate = [], []
        page.route("**/mesh/**", lambda route: route.continue_() if open_gate else held.append(route))
        visit(page, "#/hall/pt600")
        view = region(page, "3-D view")
        poster = view.get_by_role("img", name=re.compile("^Last picture of pt600"))
        expect(poster).to_be_visible()
        expect(view).to_contain_text(re.compile(r"Picture of [\d:+-]+, not live\. Loading the model…"))
        expect(view).not_to_have_class(re.compile("is-stale"))
        expect(scene_stale(page)).to_have_count(0)
        for _ in range(600):
            if held:
                break
            page.wait_for_timeout(100)
        open_gate.append(True)
        for route in held:
            route.continue_()
        expect(scene(page)).to_have_attribute("data-loaded", "true")
        expect(poster).to_have_count(0)
        expect(view).not_to_have_class(re.compile("is-stale"))
