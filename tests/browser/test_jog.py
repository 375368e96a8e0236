"""Press and hold in the Tool panel: real pointer, touch and key events move the arm only while they hold."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.robot_page import (
    ARM,
    button,
    ready,
    region,
)
from tests.site import wait_until

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)
ENDED = re.compile("Ended: ")


def hold_panel(open_page, **settings):
    page = open_page(ARM, drawn=False, **settings)
    ready(page)
    panel = region(page, "Tool")
    button(panel, "Base").click()
    button(panel, "Jog").click()
    return page, panel


def entries(plant):
    key = "robomesh/hall/arm/audit"
    found = plant.call(plant.session.last(key, timeout_s=15)).entries
    jogs = [each for each in found if each.request in ("JOG", "JOG_END")]
    return [each for each in jogs if each.outcome != each.REFUSED]


def test_a_jog_lasts_as_long_as_the_button_is_held(open_page, plant):
    page, panel = hold_panel(open_page)
    notice = panel.get_by_label("Outcome", exact=True)
    minus = button(panel, "Base Z −")
    place = minus.bounding_box()
    x, y = place["x"] + place["width"] / 2, place["y"] + place["height"] / 2
    texts = []

    def released(release, begun="[0-9]"):
        """Hold the button until the gateway has begun, and then release it in a way."""
        for _ in range(40):
            expect(minus).to_be_enabled()
            page.mouse.move(x, y)
            page.mouse.down()
            # A busy machine may be late with a keep-alive, and the arm is held then.
            expect(notice).to_contain_text(re.compile(f"Z −: {begun}|Ended|Not sent"))
            assert minus.bounding_box() == place
            release()
            # Before the pointer is up, which is a release too.
            expect(notice).to_contain_text(re.compile("Ended|Not sent"))
            page.mouse.up()
            page.evaluate("document.querySelectorAll('body > dialog').forEach((each) => each.remove())")
            texts.append(notice.inner_text())
            if "Ended: released" in texts[-1]:
                return
            if "still starting" in texts[-1]:
                page.wait_for_timeout(500)
        raise AssertionError(texts[-1])

    released(page.mouse.up, begun="[1-9]")
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
        expect(minus).to_be_enabled()
        page.keyboard.down("Enter")
        expect(notice).to_contain_text(re.compile(r"Z −: [0-9]|Ended|Not sent"))
        page.keyboard.down("Enter")
        page.keyboard.up("Enter")
        expect(notice).to_contain_text(re.compile("Ended|Not sent"))
        texts.append(notice.inner_text())
        if "Ended: released" in texts[-1]:
            break
    else:
        raise AssertionError(texts[-1])
    jogs = sum("Ended" in text for text in texts)
    # The list of the log may be older than the answer to the page.
    wait_until(lambda: entries(plant)[-1].request == "JOG_END" and len(entries(plant)) >= 2 * jogs)
    assert [each.request for each in entries(plant)] == ["JOG", "JOG_END"] * jogs
    button(page, "Release").click()
    expect(panel.get_by_role("button")).to_have_count(0)
