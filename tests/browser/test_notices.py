"""Control of a page that is slow or blocked: renewed beside it, and lost with the reason."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.robot_page import (
    ARM,
    answers_of,
    control_notice,
    region,
    stand_still,
    take,
    who_controls,
)

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)
EXACT_LEASES = True


@pytest.mark.long
def test_a_browser_that_is_seen_to_be_slow_keeps_control_and_is_told_when_it_is_too_slow(open_page):
    page, other = open_page(ARM, drawn=False), open_page(ARM, drawn=False)
    answers_come = answers_of(page)
    page.reload()
    expect(who_controls(page)).to_have_text("Nobody is in control")
    take(page, "alice")
    expect(who_controls(other)).to_have_text("alice is in control")
    stand_still(page, 2.2)  # longer than the lease of a quick browser, shorter than its own
    expect(who_controls(other)).to_have_text("alice is in control")
    expect(who_controls(page)).to_have_text("You are in control")
    # A renewal is asked for, and its answer comes too late.
    answers_come(False)
    page.wait_for_timeout(1000)
    stand_still(page, 6.5)
    answers_come(True)
    expect(control_notice(page)).to_contain_text(
        "Control ended: this browser was too slow to renew it in time."
    )
    expect(who_controls(other)).to_have_text("Nobody is in control")


def block(page, seconds):
    """Block the page's own thread, as drawing in software does."""
    page.evaluate(
        "(ms) => { const end = performance.now() + ms; while (performance.now() < end); }", seconds * 1e3
    )


def test_a_busy_page_keeps_control_and_a_blocked_one_has_lost_it_after_five_seconds(open_page):
    page, other = open_page(ARM, drawn=False), open_page(ARM, drawn=False)
    mine, holder = who_controls(page), who_controls(other)
    for _ in range(5):  # a busy machine may delay the worker as well
        page.reload()  # a page that was seen to be slow gets longer leases
        expect(holder).to_have_text("Nobody is in control")
        take(page, "alice", slow=False)
        since = region(page, "Control").get_by_text(re.compile("^since ")).inner_text()
        block(page, 2.8)
        page.wait_for_timeout(2500)  # longer than a lease: by then a page knows that it has lost it
        if mine.inner_text().startswith("You"):
            break
    expect(mine).to_have_text("You are in control")
    assert region(page, "Control").get_by_text(re.compile("^since ")).inner_text() == since
    block(page, 5)
    expect(control_notice(page)).to_contain_text("too slow")
    expect(holder).to_have_text("Nobody is in control")
