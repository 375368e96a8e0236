"""The page of an arm that ignores its stop."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.robot_page import (
    ARM,
    alarm_band,
    button,
    fault,
    ready,
    reset_stop,
    serious,
    set_speed,
    state_word,
    stop_button,
    stop_panel,
    tile,
)

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)


def test_an_arm_that_does_not_heed_its_stop_is_an_alarm_that_nothing_hides(open_page, plant):
    page, phone = open_page(ARM, drawn=False), open_page(ARM, 360, 740, drawn=False, has_touch=True)
    fleet = open_page(drawn=False)
    ready(page)
    set_speed(page, 1)
    for key in (*["PageUp"] * 5, "Enter"):
        page.get_by_role("slider", name="Target of waist").press(key)
    expect(state_word(page)).to_have_text("Moving")
    with fault(plant, "deaf"):
        stop_button(page).click()
        for each in (page, phone):
            expect(alarm_band(each)).to_have_text(
                "It moves although it was told to stop: use the emergency stop at the robot."
            )
            expect(alarm_band(each)).to_be_in_viewport(ratio=1)
            box = alarm_band(each).bounding_box()
            assert box["width"] == each.viewport_size["width"]
        phone.mouse.wheel(0, 2000)
        expect(alarm_band(phone)).to_be_in_viewport(ratio=1)
        expect(state_word(page)).to_have_text("Does not stop")
        expect(stop_panel(page)).to_contain_text(re.compile(r"Stop sent by li at \S+: the arm still moves"))
        expect(page.get_by_role("main")).not_to_contain_text("Stopped by")
        expect(page.get_by_role("button", name="Reset stop")).to_be_disabled()
        expect(stop_panel(page)).to_contain_text("It can be reset when the arm rests")
        expect(tile(fleet, "arm")).to_contain_text("use the emergency stop at the robot")
        # Of the page that is not in control: the check may block a page for longer than control lasts.
        assert serious(phone) == []
    # The stop is sent again each 2 s; now it is heeded.
    expect(state_word(page)).to_have_text("Stopped")
    expect(stop_panel(page)).to_contain_text("Stopped by li")
    past = alarm_band(page).filter(has_text="moved on")
    expect(past).to_have_text(re.compile(r"At \S+ it moved on although it was told to stop"))
    button(past, "Dismiss").click()
    expect(past).to_have_count(0)
    reset_stop(page)
    set_speed(page, 100)
    button(page, "Release").click()
