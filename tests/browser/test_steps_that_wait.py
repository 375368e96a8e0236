"""Steps by the ± buttons, by each kind of pointer: one waits at most."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.hand import MOUSE, PEN, TOUCH, Hand, centre_of
from tests.browser.robot_page import (
    ARM,
    audited,
    button,
    degrees,
    joints_notice,
    ready,
    region,
    set_speed,
    state_word,
)
from tests.site import wait_until

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)
DROPPED = "The step that waited is not sent"


@pytest.fixture
def steps_page(open_page):
    page = open_page(ARM, drawn=False)
    ready(page)
    yield page
    set_speed(page, 100)
    button(page, "Release").click()


def arrives(page, end):
    """Wait until the waist is there [degrees]: it may be Idle because the motion has not begun."""
    wait_until(lambda: degrees(page, "waist") == pytest.approx(end, abs=0.1))
    expect(state_word(page)).to_have_text("Idle")


@pytest.mark.parametrize(
    "kind", [MOUSE, *(pytest.param(each, marks=pytest.mark.long) for each in (TOUCH, PEN))]
)
def test_twenty_quick_taps_turn_the_arm_by_the_taps_that_were_taken(steps_page, plant, kind):
    page, hand = steps_page, Hand(steps_page, kind)
    button(region(page, "Joints"), "5").click()
    plus = button(page, "waist +5°")
    x, y = centre_of(plus)
    taken, from_ = audited(plant, "MOVE_RELATIVE"), degrees(page, "waist")
    for _ in range(20):
        hand.press(x, y)
        hand.lift()
    last = degrees(page, "waist")
    # On a busy machine the values may be too old for the step that waits.
    expect(joints_notice(page)).to_have_text(re.compile(f"^(Done: waist|Not sent|{DROPPED})"))
    page.wait_for_timeout(1000)  # nothing comes later
    end = from_ + 5 * (audited(plant, "MOVE_RELATIVE") - taken)
    arrives(page, end)
    assert end - last <= 10.1  # the rest of the step that was going, and the one that waited
