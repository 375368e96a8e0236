"""Steps of the tool along the axes of a frame, as the numbers of the Tool panel show them."""

import pytest
from playwright.sync_api import expect

from tests.browser.robot_page import (
    ARM,
    button,
    ready,
    region,
    tool_values,
)

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)


def place_of(page):
    values = tool_values(page).all_inner_texts()[:3]
    return [float(each.split()[0].replace("−", "-").rstrip("m")) for each in values]


def test_steps_of_the_tool_are_straight_lines_one_for_each_press(open_page):
    page = open_page(ARM, drawn=False)
    ready(page)
    steps = region(page, "Tool")
    notice = steps.get_by_label("Outcome", exact=True)
    x, y, z = place_of(page)
    button(steps, "Base").click()
    button(steps, "Base X +5\u202fmm").click()
    expect(notice).to_contain_text("Done: Base X +5")
    assert place_of(page) == pytest.approx([x + 5, y, z], abs=0.2)
    button(steps, "20").click()
    for _ in range(2):
        button(steps, "Base Z −20\u202fmm").click()
    expect(notice).to_contain_text("Done: Base Z −20")
    expect(tool_values(page).nth(2)).to_contain_text(f"{z - 40:.1f}")
    assert place_of(page) == pytest.approx([x + 5, y, z - 40], abs=0.2)
    # Five joints: no line turns the tool about its axis.
    button(steps, "Tool").click()
    button(steps, "Tool yaw +20°").click()
    expect(notice).to_contain_text("move a joint instead")
    button(page, "Release").click()
    expect(steps.get_by_role("button")).to_have_count(0)
