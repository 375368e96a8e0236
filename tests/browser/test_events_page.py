"""Alarms on the page, from a real watch: all pages show a change of one page."""

import pytest
from playwright.sync_api import expect

from robomesh.schemas import robomesh_pb2 as schema
from tests.browser.robot_page import alarms, button, region, tile

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)

EVENTS = "#/events"
Event = schema.Event


def badge(page, words):
    """Return the link to the alarms in the bar, which says how many there are."""
    return page.get_by_role("banner").get_by_role("link", name=words)


def line(page, text):
    return alarms(page).filter(has_text=text)


def test_who_acknowledges_an_alarm_on_one_page_has_done_so_on_every_page(open_page, raised):
    fleet, mine, other = (open_page(path, drawn=False) for path in ("", EVENTS, EVENTS))
    raised("joints.gone", "no positions come from it")
    for page in (mine, other):
        expect(line(page, "no positions come").get_by_text("not acknowledged", exact=True)).to_be_visible()
        expect(line(page, "no positions come").get_by_text("high", exact=True)).to_be_visible()
        # Two sites may each have one of that id.
        expect(line(page, "no positions come").get_by_role("code")).to_have_text("hall/arm:joints.gone")
    expect(badge(fleet, "Unacknowledged alarms: 1 high")).to_be_visible()
    expect(tile(fleet, "arm").get_by_text("high", exact=True)).to_be_visible()
    acknowledge = button(mine, "Acknowledge: no positions come from it")
    expect(acknowledge).to_be_disabled()
    mine.get_by_label("Your name").fill("li")
    acknowledge.click()
    expect(region(mine, "Alarms").get_by_label("Outcome", exact=True)).to_have_text("Acknowledged: 1")
    expect(line(other, "no positions come").get_by_text("acknowledged", exact=True)).to_be_visible()
    expect(line(other, "no positions come")).to_contain_text("acknowledged by li at")
    expect(badge(fleet, "No unacknowledged alarm")).to_be_visible()
    raised("joints.back", "positions come again", Event.INFO)
    for page in (mine, other):
        expect(line(page, "no positions come")).to_have_count(0)
    expect(tile(fleet, "arm").get_by_text("high", exact=True)).to_have_count(0)
