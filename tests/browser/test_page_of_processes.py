"""From unit to pixel through real processes: `robomesh up`, and its page in a real Chromium."""

import json

import pytest
from playwright.sync_api import expect

from tests.browser.conftest import PATIENCE_MS
from tests.browser.robot_page import (
    button,
    degrees,
    drag,
    ready,
    reset_stop,
    sent,
    state_word,
    stop_button,
    wait_to_move,
)
from tests.site import robomesh, running_site, wait_until

pytestmark = [pytest.mark.browser, pytest.mark.processes]


@pytest.fixture
def site(tmp_path, request):
    """Yield a site with the services that a test names."""
    with running_site(tmp_path, services=getattr(request, "param", ())) as running:
        yield running


@pytest.mark.parametrize("site", [("recorder", "renderer")], ids=["recorded"], indirect=True)
def test_home_trace_move_and_stop_from_the_page_reach_the_controller_and_the_recording(site, shared_chromium):
    with shared_chromium.driven() as browser:
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.set_default_timeout(PATIENCE_MS)
        page.goto(f"{site.console}#/test/arm")
        ready(page)

        sent(page, button(page, "Trace on").click)
        expect(button(page, "Trace off")).to_be_visible()
        wait_until(lambda: recordings(site) and recordings(site)[0]["topics"], what="no recording began")
        before = degrees(page, "waist")
        wait_to_move(page, "waist", lambda: drag(page, "waist", 60))
        expect(state_word(page)).to_have_text("Idle")
        assert degrees(page, "waist") > before + 5

        wait_to_move(page, "waist", lambda: drag(page, "waist", -120))
        stop_button(page).click()
        expect(state_word(page)).to_have_text("Stopped")
        reset_stop(page)
        sent(page, button(page, "Trace off").click)
        wait_until(lambda: not recordings(site)[0]["open"], what="the recording did not close")
        button(page, "Release").click()
    (recording,) = recordings(site)
    counts = {topic["topic"].removeprefix("robomesh/test/arm/"): topic for topic in recording["topics"]}
    assert counts["joints"]["messages"] > 25
    assert counts["joints"]["lost"] == 0
    assert counts["audit"]["messages"] >= 3
    assert counts["video/free"]["messages"] > 0


def recordings(site):
    lines = robomesh("recordings", "list", "--json", "--connect", site.router).stdout.splitlines()
    return [json.loads(line) for line in lines]
