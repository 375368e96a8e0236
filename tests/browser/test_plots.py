"""Plots of any field, and a layout that opens the same in another browser."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.robot_page import (
    ARM,
    button,
    serious,
)

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)


def values(page, plot):
    return page.get_by_role("region", name=f"Plot {plot}").get_by_role("listitem")


def test_a_field_is_found_by_typing_and_a_layout_opens_the_same_on_another_screen(open_page):
    page = open_page(ARM, drawn=False)
    button(page, "Add plot").click()
    button(page, "Fields of plot 2").click()
    for words in ("tool x", "rate hz"):
        page.get_by_label("Filter values").fill(words)
        page.get_by_role("region", name="Plot 2").get_by_role("checkbox").first.check()
    assert serious(page, ".history") == []
    button(page, "Fields of plot 2").click()
    page.get_by_label("Time range of plot 2").select_option("600")
    expect(values(page, 2)).to_have_text([re.compile(r"mm$"), re.compile(r"Hz$")])
    # There is no recorder at this site.
    expect(page.get_by_role("region", name="Plot 2")).to_contain_text("The past cannot be read")
    page.get_by_label("View", exact=True).last.select_option("top")
    address = page.evaluate("location.hash")
    assert address == f"{ARM}?plot=60,joints&plot=600,kinematics/tool/x,controller/rate_hz&video=top"
    button(page, "Layout…").click()
    assert serious(page, ".layout-panel") == []

    other = open_page(address, drawn=False, width=360, height=740)
    expect(values(other, 1)).to_have_count(5)
    expect(values(other, 2)).to_have_text([re.compile(r"mm$"), re.compile(r"Hz$")])
    expect(other.get_by_label("Time range of plot 2")).to_have_value("600")
    expect(other.get_by_label("View", exact=True).last).to_have_value("top")
    button(other, "Pause").click()
    expect(other.get_by_text(re.compile("^Paused at"))).to_be_visible()
