"""Steps by the ± buttons: one waits at most, the page says where it ends, and anything else drops it."""

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
    keep_picture,
    ready,
    region,
    set_speed,
    state_word,
    tool_values,
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


def let_one_wait(page, name):
    """Press a button until one slow step is going and one waits; return where the waist was [degrees]."""
    set_speed(page, 2)
    button(region(page, "Joints"), "5").click()
    for _ in range(20):
        expect(state_word(page)).to_have_text("Idle")
        expect(button(page, name)).to_be_enabled()
        from_ = degrees(page, "waist")
        button(page, name).click()
        button(page, name).click()
        # On a busy machine the second press may come after the first step, or be refused.
        expect(joints_notice(page)).not_to_have_text(re.compile("^Sen[dt]"))
        if "1 step waits" in joints_notice(page).inner_text():
            return from_
    raise AssertionError(joints_notice(page).inner_text())


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


def test_the_page_says_what_waits_and_where_it_ends_and_takes_no_third(steps_page):
    page = steps_page
    from_ = let_one_wait(page, "waist +5°")
    place = button(page, "waist +5°").bounding_box()
    end = f"{from_ + 10:.2f}".replace("-", "−")
    expect(joints_notice(page)).to_have_text(f"1 step waits; ends at {end}°.")
    button(page, "waist +5°").click()
    expect(joints_notice(page)).to_have_text(f"1 step waits; ends at {end}°. Further presses are not taken.")
    assert button(page, "waist +5°").bounding_box() == place
    keep_picture(page, "step-waits")
    expect(joints_notice(page)).to_have_text(re.compile("^Done"))
    expect(state_word(page)).to_have_text("Idle")
    assert degrees(page, "waist") == pytest.approx(from_ + 10, abs=0.1)


def test_the_end_of_a_waiting_step_of_the_tool_is_where_the_tool_arrives(steps_page):
    page = steps_page
    panel = region(page, "Tool")
    notice = panel.get_by_label("Outcome", exact=True)
    button(panel, "Base").click()
    for name in ("Base Z −5\u202fmm", "Base X +5\u202fmm"):
        said = []
        while not said:  # on a busy machine the second press may come after the first step
            expect(button(panel, name)).to_be_enabled()
            expect(state_word(page)).to_have_text("Idle")
            button(panel, name).click()
            button(panel, name).click()
            expect(notice).not_to_have_text(re.compile("^Sen[dt]"))
            text = notice.inner_text()
            said = re.findall(r"[xyz] (−?\d+\.\d)", text) if "1 step waits; ends at x" in text else []
        expect(notice).to_contain_text("Done")
        expect(state_word(page)).to_have_text("Idle")
        arrived = [each.split()[0] for each in tool_values(page).all_inner_texts()[:3]]
        assert [float(each.replace("−", "-").rstrip("m")) for each in arrived] == pytest.approx(
            [float(each.replace("−", "-")) for each in said], abs=0.2
        )
