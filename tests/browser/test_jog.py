"""Press and hold in the Tool panel: real pointer, touch and key events move the arm only while they hold."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.robot_page import ARM, button, ready
from tests.site import wait_until

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)
ENDED = re.compile("Ended: ")


def hold_panel(open_page, **settings):
    page = open_page(ARM, drawn=False, **settings)
    ready(page)
    panel = page.locator(".panel.tool")
    button(panel, "Base").click()
    button(panel, "Jog").click()
    return page, panel


def entries(plant):
    key = "robomesh/hall/arm/audit"
    found = plant.call(plant.session.last(key, timeout_s=15)).entries
    return [each for each in found if each.request in ("JOG", "JOG_END")]


def test_a_jog_lasts_as_long_as_the_button_is_held(open_page, plant):
    page, panel = hold_panel(open_page)
    notice = panel.locator(".notice")
    minus = button(panel, "Base Z −")
    place = minus.bounding_box()
    x, y = place["x"] + place["width"] / 2, place["y"] + place["height"] / 2

    def released(release):
        """Hold the button until the arm moves, and then release it in a way; return the end's reason."""
        for _ in range(40):
            expect(minus).to_be_enabled()
            page.mouse.move(x, y)
            page.mouse.down()
            # A busy machine may be late with a keep-alive, and the arm is held then.
            expect(notice).to_contain_text(re.compile(r"Z −: [1-9]|Ended|Not sent"))
            assert minus.bounding_box() == place
            release()
            # Before the pointer is up, which is a release too.
            expect(notice).to_contain_text(re.compile("Ended|Not sent"))
            page.mouse.up()
            page.evaluate("document.querySelectorAll('body > dialog').forEach((each) => each.remove())")
            text = notice.inner_text()
            if "Ended: released" in text:
                return
            if "still starting" in text:
                page.wait_for_timeout(500)
        raise AssertionError(text)

    released(page.mouse.up)
    released(lambda: page.evaluate("window.dispatchEvent(new Event('blur'))"))
    released(lambda: page.evaluate("document.body.appendChild(document.createElement('dialog')).showModal()"))
    # A second touch anywhere.
    released(
        lambda: page.evaluate(
            "document.body.dispatchEvent(new PointerEvent('pointerdown', {pointerId: 77, bubbles: true}))"
        )
    )
    released(
        lambda: page.evaluate(
            "document.activeElement.dispatchEvent(new PointerEvent('pointercancel', {pointerId: 1}))"
        )
    )
    # Enter held: its repeats begin no second jog.
    minus.focus()
    for _ in range(40):
        since = entries(plant)[-1].timestamp.ToNanoseconds()
        expect(minus).to_be_enabled()
        page.keyboard.down("Enter")
        expect(notice).to_contain_text(re.compile(r"Z −: [1-9]|Ended|Not sent"))
        page.keyboard.down("Enter")
        page.keyboard.up("Enter")
        expect(notice).to_contain_text(re.compile("Ended|Not sent"))
        if "Ended: released" in notice.inner_text():
            break
    else:
        raise AssertionError(notice.inner_text())
    wait_until(lambda: entries(plant)[-1].request == "JOG_END")
    own = [each.request for each in entries(plant) if each.timestamp.ToNanoseconds() > since]
    assert own == ["JOG", "JOG_END"]
    button(page, "Release").click()
    expect(panel.get_by_role("button")).to_have_count(0)
