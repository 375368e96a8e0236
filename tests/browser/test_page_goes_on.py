"""The page after a lost connection, a sleeping machine, missing files or a wrong link."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.robot_page import ARM, button

pytestmark = pytest.mark.browser

STATE = ".headline .state"
# A connection through which nothing passes any more, a machine that sleeps, and time that passes.
DEAD, SLEPT, PASSED = "sockets.at(-1).dead = true", "wall += {}", "steady += {}"
WORLD = """
window.sockets = [];
window.wall = window.steady = 0;
const [date, now] = [Date.now.bind(Date), performance.now.bind(performance)];
Date.now = () => date() + wall + steady;
performance.now = () => now() + steady;
window.WebSocket = class extends WebSocket {
  constructor(...values) {
    super(...values);
    sockets.push(this);
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


def until(page, true):
    """Wait for a condition that the page's policy lets no locator evaluate."""
    for _ in range(400):
        if page.evaluate(true):
            return
        page.wait_for_timeout(100)
    raise AssertionError(f"it never came to {true}")


def test_a_line_that_died_in_silence_is_told_and_opened_anew_and_sleep_makes_nothing_young(open_page):
    page = open_page(ARM, drawn=False)
    page.add_init_script(WORLD)
    page.reload()
    expect(page.locator(STATE)).to_have_text("Idle")
    expect(page.locator("main")).not_to_contain_text("stale")
    page.evaluate(DEAD)
    page.evaluate(SLEPT.format(3600e3))
    expect(page.locator("main")).to_contain_text(re.compile(r"stale 6\d\smin"))
    expect(page.locator(STATE)).to_have_text("Stale")
    lost = page.locator(".banner").filter(has_text="No connection to the console since")
    expect(lost).to_have_count(0)
    page.evaluate(PASSED.format(6e3))
    until(page, "sockets[0].lost > 0")  # it asks whether anybody is there
    page.evaluate(PASSED.format(16e3))
    until(page, "sockets.length > 1")
    page.evaluate("steady = 0")  # no source is behind by it
    expect(lost).to_have_count(0)
    expect(page.locator(STATE)).to_have_text("Idle")
    expect(page.locator("main")).not_to_contain_text("stale")


def test_a_stop_request_that_a_dead_line_swallowed_opens_another_for_the_next_one(open_page):
    page = open_page(ARM, drawn=False)
    page.add_init_script(WORLD)
    page.reload()
    expect(page.locator(STATE)).to_have_text("Idle")
    page.evaluate(DEAD)
    page.locator("button.stop").click()
    expect(page.locator(".stop-notice.refused")).to_contain_text("no answer in 2 s")
    until(page, "sockets.length > 1 && sockets.at(-1).readyState === WebSocket.OPEN")
    page.locator("button.stop").click()
    expect(page.locator(".stop-notice.done")).to_contain_text("Stop sent to hall/arm")


def test_a_page_whose_part_is_no_longer_there_says_so(open_page):
    page = open_page(drawn=False)
    expect(page.locator(".tile")).not_to_have_count(0)
    page.route("**/assets/wall-*.js", lambda route: route.fulfill(status=504))
    page.evaluate("location.hash = '#/wall'")
    expect(page.locator("main [role=alert]")).to_contain_text("This page could not be loaded")
    page.unroute("**/assets/wall-*.js")
    button(page, "Load again").click()
    expect(page.locator(".wall-tile").first).to_be_visible()


def test_a_link_to_what_no_robot_can_be_called_is_said_and_costs_no_connection(open_page):
    page = open_page(drawn=False)
    page.add_init_script(WORLD)
    for path, robot in (
        ("#/Hall/arm", "arm at Hall"),
        ("#/hall/a%2Fb", "a/b at hall"),
        ("#/hall/%zz", "%zz at hall"),
    ):
        page.evaluate("path => (location.hash = path)", path)
        page.reload()
        expect(page.locator("h1")).to_have_text(f"There is no robot {robot}.")
        expect(page.locator(".missing li")).not_to_have_count(0)
        expect(button(page, "Stop request: all")).to_be_enabled()
        assert page.evaluate("sockets.length") == 1
