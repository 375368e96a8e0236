"""Stop requests of a page whose connection is dead or lost."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.robot_page import (
    ARM,
    button,
    clear_stop,
    state_word,
    stop_button,
    stop_notice,
    take,
    until,
)

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)

# Connections through which nothing passes any more.
LINE_DEAD, STOPS_DEAD = "sockets.at(-1).dead = true", "stopSockets.at(-1).dead = true"
DEAD = f"{LINE_DEAD}; {STOPS_DEAD}"
WORLD = """
window.sockets = [];
window.stopSockets = [];
window.wall = 0;
const date = Date.now.bind(Date);
Date.now = () => date() + wall;
window.WebSocket = class extends WebSocket {
  constructor(...values) {
    super(...values);
    (this.url.endsWith("/stop") ? stopSockets : sockets).push(this);
  }
  send(data) {
    if (this.dead) this.lost = (this.lost ?? 0) + 1;
    else super.send(data);
  }
  set onmessage(hear) {
    super.onmessage = hear && ((event) => this.dead || hear(event));
  }
};
"""


def open_idle(open_page):
    """Open the arm's page with a clock and a connection that the test controls."""
    page = open_page(ARM, drawn=False, script=WORLD)
    expect(state_word(page)).to_have_text("Idle")
    return page


def test_a_stop_request_that_a_dead_line_swallowed_is_sent_by_another(open_page):
    page = open_idle(open_page)
    page.evaluate(DEAD)
    stop_button(page).click()
    page.evaluate("wall -= 60e3")  # it is recent, however slow this machine is
    until(page, lambda: page.evaluate("sockets[0].lost > 0 && sockets.length > 1"))
    expect(stop_notice(page)).to_contain_text("Stop sent to hall/arm")
    take(page)
    clear_stop(page)


@pytest.mark.parametrize("dead", [LINE_DEAD, STOPS_DEAD])
def test_a_stop_request_needs_only_one_of_the_pages_two_lines(open_page, dead):
    page = open_idle(open_page)
    until(page, lambda: page.evaluate("stopSockets.at(-1)?.readyState === WebSocket.OPEN"))
    page.evaluate(dead)
    stop_button(page).click()
    expect(stop_notice(page)).to_contain_text("Stop sent to hall/arm")
    assert page.evaluate("sockets.length") == 1
    take(page)
    clear_stop(page)


def test_a_stop_that_cannot_be_sent_is_shown_so_and_sent_when_the_connection_returns(open_page, plant):
    page = open_idle(open_page)
    stop, notice = stop_button(page), stop_notice(page)
    place = stop.bounding_box()
    with plant.standing_still():
        expect(stop).to_have_text("Stop cannot be sent: use the emergency stop")
        assert stop.bounding_box() == place
        expect(button(page, "Take control")).to_be_disabled()
        expect(stop).to_be_enabled()
        stop.click()
        expect(page.get_by_role("banner").get_by_role("alert")).to_contain_text(
            re.compile(r"^\d\d:\d\d:\d\d[+-]\d\d:\d\d Stop request to hall/arm failed")
        )
        expect(button(page, "Send again")).to_have_count(0)  # nothing can be sent
        page.evaluate("wall -= 60e3")  # it is recent, however slow this machine is
    # The whole site stood still, so its gateway may have lost the controller for a moment.
    expect(notice).to_contain_text(re.compile("Stop (sent to|latched for) hall/arm"))
    expect(stop).to_have_text("Stop request")
    take(page)
    clear_stop(page)


def test_an_old_press_of_stop_is_offered_when_the_connection_returns(open_page, plant):
    page = open_idle(open_page)
    stop, failed = stop_button(page), page.get_by_role("banner").get_by_role("alert")
    page.evaluate(DEAD)
    with plant.standing_still():
        stop.click()
        expect(failed).to_contain_text("Stop request to hall/arm failed")
        page.evaluate("wall += 11e3")  # longer than a press is meant
    again = button(page, "Send again")
    expect(again).to_be_visible()
    expect(state_word(page)).to_have_text("Idle")
    again.click()
    expect(stop_notice(page)).to_contain_text(re.compile("Stop (sent to|latched for) hall/arm"))
    expect(again).to_have_count(0)
    take(page)
    clear_stop(page)
