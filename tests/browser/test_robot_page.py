"""The robot's page in a real Chromium on a real site: display, control, stop."""

import re
from contextlib import suppress

import pytest
from playwright.sync_api import expect

from tests.browser.robot_page import (
    ARM,
    audited,
    button,
    degrees,
    drag,
    joint_track,
    joint_value,
    joints_notice,
    ready,
    region,
    reset_stop,
    scene,
    scene_stale,
    state_word,
    stop_button,
    stop_notice,
    stop_panel,
    tiles,
    tool_values,
)
from tests.site import wait_until

pytestmark = pytest.mark.browser


def test_a_moving_arm_is_drawn_as_it_moves(open_page):
    page = open_page("#/hall/pt600")
    expect(scene(page)).to_have_attribute("data-loaded", "true")
    before = degrees(page, "waist"), int(scene(page).get_attribute("data-drawn"))
    wait_until(lambda: int(scene(page).get_attribute("data-drawn")) > before[1] + 3)
    expect(joint_value(page, "waist")).not_to_have_text(f"{before[0]:.2f}°".replace("-", "−"))
    expect(scene_stale(page)).to_have_count(0)
    expect(tool_values(page).first).to_have_text(re.compile(r"\d+\.\d\s*mm"))


def test_a_slider_moves_the_joint_when_it_is_let_go_and_not_before(open_page, plant):
    page = open_page(ARM)
    ready(page)
    moves, start = audited(plant, "MOVE_ABSOLUTE"), degrees(page, "waist")

    def has_target():
        drag(page, "waist", 30, release=False)
        with suppress(AssertionError):  # a handle that has just moved ignores a press
            expect(joints_notice(page)).to_contain_text(
                re.compile("Target waist:|No new motion:"), timeout=5000
            )
        return "Target waist:" in joints_notice(page).inner_text()

    while not has_target():
        page.mouse.up()  # the machine stood still
        if page.get_by_label("Your name").is_enabled():
            ready(page)
    assert audited(plant, "MOVE_ABSOLUTE") == moves
    # Every link beyond the waist is shown where it would be.
    expect(scene(page)).to_have_attribute("data-ghost", "5")
    wanted = float(re.search(r"waist: (\S+)°", joints_notice(page).inner_text())[1].replace("−", "-"))
    assert wanted > start + 5
    page.mouse.up()
    expect(joint_value(page, "waist")).to_have_text(f"{wanted:.2f}°".replace("-", "−"))
    assert audited(plant, "MOVE_ABSOLUTE") > moves
    # A tap next to the handle sets no target.
    moves = audited(plant, "MOVE_ABSOLUTE")
    box = joint_track(page, "waist").bounding_box()
    page.mouse.click(box["x"] + 4, box["y"] + box["height"] / 2)
    expect(joints_notice(page)).not_to_contain_text("Target waist")
    assert audited(plant, "MOVE_ABSOLUTE") == moves


def test_space_asks_for_a_stop_and_only_its_reset_lets_motion_go_on(open_page):
    page = open_page(ARM, drawn=False)
    ready(page)
    drag(page, "waist", -60)
    page.keyboard.press("Space")
    expect(stop_notice(page)).to_contain_text("Stop sent to hall/arm")
    expect(state_word(page)).to_have_text("Stopped")
    expect(button(page, "Home")).to_be_disabled()
    reset_stop(page)
    expect(button(page, "Home")).to_be_enabled()


def test_stop_works_without_control_and_names_who_asked(open_page):
    page = open_page(ARM, drawn=False)
    page.get_by_label("Your name").fill("wang")
    stop_button(page).click()
    expect(stop_panel(page)).to_contain_text("Stopped by wang")
    expect(stop_panel(page).get_by_role("paragraph")).to_have_text("No motion until it is reset.")
    expect(page.get_by_role("button", name="Reset stop")).to_be_disabled()


def test_when_the_controller_falls_silent_nothing_looks_live(open_page, plant):
    page = open_page("#/hall/pt600")
    expect(scene(page)).to_have_attribute("data-loaded", "true")
    expect(scene_stale(page)).to_have_count(0)
    port = plant.call(plant.stop_controller("pt600"))
    try:
        expect(scene_stale(page)).to_contain_text(re.compile(r"stale \d"))
        expect(joint_value(page, "waist")).to_have_class(re.compile("stale"))
        expect(state_word(page)).to_have_text("No link")
        expect(stop_button(page)).to_have_text("Stop cannot arrive: use the emergency stop")
    finally:
        plant.call(plant.start_controller("pt600", port, demo=True))
    expect(scene_stale(page)).to_have_count(0)


def test_a_phone_shows_one_column_with_stop_under_the_thumb(open_page):
    page = open_page(width=360, height=740, has_touch=True, drawn=False)
    for path, there in (("#/", tiles(page).first), ("#/hall/pt600", joint_value(page, "waist"))):
        page.evaluate("path => (location.hash = path)", path)
        expect(there).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth") == 360
        stop = stop_button(page).bounding_box()
        assert stop["height"] >= 44
        assert stop["y"] + stop["height"] <= 740
        small = page.evaluate(
            "[...document.querySelectorAll('button, input, a.tile')]"
            ".filter(e => e.offsetParent && e.getBoundingClientRect().height < 44)"
            ".map(e => e.outerHTML.slice(0, 80))"
        )
        assert small == []


@pytest.mark.long
def test_a_control_room_sees_everything_of_a_robot_without_scrolling(open_page):
    page = open_page("#/hall/pt600", drawn=False)
    expect(joint_value(page, "waist")).to_be_visible()
    assert page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]") == [
        1440,
        900,
    ]
    for name in ("3-D view", "Control", "Joints", "Tool", "Events", "Video", "Plots"):
        box = region(page, name).bounding_box()
        assert box["y"] + box["height"] <= 900, name
        assert box["height"] >= 80, name


@pytest.mark.long
def test_video_and_plots_change_their_places_and_stop_stays_where_it_is(open_page):
    page = open_page(ARM, drawn=False)
    stop = stop_button(page).bounding_box()
    place = page.get_by_label("Where the video stands")
    place.select_option("large")
    sizes = [region(page, name).bounding_box()["height"] for name in ("Video", "3-D view")]
    assert sizes[0] > 1.5 * sizes[1]
    assert stop_button(page).bounding_box() == stop
    place.select_option("inset")
    inset, large = (region(page, name).bounding_box() for name in ("Video", "3-D view"))
    assert inset["y"] > large["y"]
    assert inset["x"] + inset["width"] < large["x"] + large["width"]
    place.select_option("beside")
    assert region(page, "3-D view").bounding_box()["height"] == pytest.approx(sizes[0], abs=2)
    button(page, "Layout…").click()
    control = region(page, "Control").bounding_box()
    for name in ("Video", "Plots"):
        page.get_by_role("checkbox", name=name).uncheck()
        expect(region(page, name)).to_have_count(0)
    assert region(page, "Control").bounding_box() == control
    assert stop_button(page).bounding_box() == stop
