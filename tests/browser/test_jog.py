"""Press and hold in the Tool panel: real input of each kind moves the arm only while it holds."""

import re
from contextlib import suppress

import pytest
from playwright.sync_api import expect

from protocol_gateway.audit.log import Outcome, read_entries
from tests.browser.hand import COVER, MOUSE, PEN, SHOW_DIALOG, TOUCH, UNCOVER, Hand, centre_of
from tests.browser.robot_page import (
    ARM,
    audited,
    button,
    ready,
    region,
)
from tests.site import wait_until

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)
# In this browser no window is ever hidden.
HIDE = """hidden => { Object.defineProperty(document, "hidden", {value: hidden, configurable: true});
  if (hidden) document.dispatchEvent(new Event("visibilitychange")); }"""
TAKE_CAPTURE = """() => { const held = document.activeElement;
  for (let id = 0; id < 999; id++) if (held.hasPointerCapture(id)) document.body.setPointerCapture(id); }"""
# Times of a gesture's steps [ms].
STEPS = """() => { for (const kind of ["down", "move", "up"])
  addEventListener(`pointer${kind}`, each => steps.push(each.timeStamp), {capture: true}); }"""
REST_MS = 120
# A refusal may say the same as the one before.
CLEAR = """notice => {
  for (const each of notice.childNodes) if (each.nodeType === Node.TEXT_NODE) each.data = ""; }"""


@pytest.fixture
def jog_page(open_page):
    page = open_page(ARM, drawn=False)
    ready(page)
    panel = region(page, "Tool")
    button(panel, "Base").click()
    button(panel, "Jog").click()
    begin_checks(page, panel)
    yield page
    button(page, "Release").click()
    expect(panel.get_by_role("button")).to_have_count(0)


def begin_checks(page, panel):
    """Jog for a moment: the first jog of a robot starts the process that checks the way."""
    hand, notice = Hand(page, MOUSE), panel.get_by_label("Outcome", exact=True)
    for _ in range(40):
        hand.press(*centre_of(button(panel, "Base Z −")))
        with suppress(AssertionError):  # a button that has just moved ignores a press
            expect(notice).to_contain_text(re.compile("Z −: [0-9]|Ended|Not sent"), timeout=10_000)
        hand.lift()
        if re.search("Z −: [0-9]|Ended", notice.inner_text()):
            expect(notice).to_contain_text("Ended")
            return
        page.wait_for_timeout(500)
    raise AssertionError(notice.inner_text())


def entries(plant):
    found = read_entries(plant.audit / "hall" / "arm.jsonl")
    jogs = [each for each in found if each.request in ("JOG", "JOG_END")]
    return [each for each in jogs if each.outcome != Outcome.REFUSED]


@pytest.mark.parametrize("kind", [MOUSE, TOUCH, pytest.param(PEN, marks=pytest.mark.long)])
def test_each_end_of_a_hold_ends_the_jog_and_says_why(jog_page, plant, kind):
    page, hand = jog_page, Hand(jog_page, kind)
    panel = region(page, "Tool")
    notice = panel.get_by_label("Outcome", exact=True)
    buttons = [button(panel, f"Base Z {sign}") for sign in "−+"]
    buttons[0].scroll_into_view_if_needed()
    other = page.context.new_page()
    hand.focus_is_real(True)
    page.bring_to_front()
    page.wait_for_function("() => document.hasFocus()")
    texts = []

    def ends(why, end, begun="[0-9]"):
        """Hold a button until the gateway has begun, and then end the hold in a way."""
        for _ in range(40):
            held = buttons[len(texts) % 2]  # so that the arm stays where it is
            expect(held).to_be_enabled()
            x, y = centre_of(held)
            place = held.bounding_box()
            notice.evaluate(CLEAR)
            hand.press(x, y)
            # A busy machine may be late with a keep-alive, and the arm is held then.
            with suppress(AssertionError):
                expect(notice).to_contain_text(re.compile(f"Z .: {begun}|Ended|Not sent"), timeout=10_000)
            if not re.search("Z .:|Ended|Not sent", notice.inner_text()):
                hand.lift()  # a button that has just moved ignores a press
                continue
            expect(notice).to_contain_text(re.compile(f"Z .: {begun}|Ended|Not sent"))
            assert held.bounding_box() == place
            end(x, y, place)
            # Before the pointer is up, which is a release too.
            expect(notice).to_contain_text(re.compile("Ended|Not sent"))
            hand.lift()
            page.evaluate(UNCOVER)
            texts.append(notice.inner_text())
            if f"Ended: {why}" in texts[-1]:
                return
            assert re.search("still starting|late|busy|150 ms|delayed", texts[-1]), texts[-1]
            page.wait_for_timeout(500)
        raise AssertionError(texts[-1])

    def lose_focus():
        other.bring_to_front()
        expect(notice).to_contain_text("Ended")
        page.bring_to_front()
        page.wait_for_function("() => document.hasFocus()")

    def lose_capture(x, y, _):
        hand.move(x + 20, y)  # a touch has no event before it moved 15 px, and capture changes with an event
        page.evaluate(TAKE_CAPTURE)
        hand.move(x + 10, y)

    ends("released", lambda *_: hand.lift(), begun="[1-9]")
    ends("the pointer left the button", lambda x, _, place: hand.move(x, place["y"] + place["height"] + 16))
    ends("another pointer", lambda x, y, _: hand.press_another(x + 200, y))
    ends("another pointer", lambda *_: page.keyboard.press("a"))
    ends("the browser took the pointer", lose_capture)
    ends("another window", lambda *_: lose_focus())
    ends("a dialog opened", lambda *_: page.evaluate(SHOW_DIALOG))
    ends("the button was covered", lambda x, y, place: page.evaluate(COVER, place))
    if kind == TOUCH:
        ends("the browser took the pointer", lambda *_: hand.cancel())
    jogs = sum("Ended" in text for text in texts)
    # The list of the log may be older than the answer to the page.
    wait_until(lambda: [each.request for each in entries(plant)][-2 * jogs :] == ["JOG", "JOG_END"] * jogs)
    # Back on the button after its end, it does not begin again.
    before, last = len(entries(plant)), notice.inner_text()
    x, y = centre_of(buttons[0])
    hand.press(x, y)
    expect(notice).not_to_have_text(last)
    expect(notice).to_contain_text(re.compile("Z .: [0-9]|Ended"))
    hand.move(x, y + 60)
    hand.move(x, y)
    expect(notice).to_contain_text("Ended")
    page.wait_for_timeout(500)
    hand.lift()
    wait_until(lambda: len(entries(plant)) == before + 2)
    other.close()


def test_enter_holds_and_its_repeats_begin_no_second_jog(jog_page, plant):
    panel = region(jog_page, "Tool")
    notice = panel.get_by_label("Outcome", exact=True)
    minus = button(panel, "Base Z −")
    before = audited(plant, "JOG")
    minus.focus()
    presses = 0
    while presses < 40:
        presses += 1
        expect(minus).to_be_enabled()
        jog_page.keyboard.down("Enter")
        expect(notice).to_contain_text(re.compile(r"Z −: [0-9]|Ended|Not sent"))
        jog_page.keyboard.down("Enter")
        jog_page.keyboard.up("Enter")
        expect(notice).to_contain_text(re.compile("Ended|Not sent"))
        if "Ended: released" in notice.inner_text():
            break
    wait_until(lambda: audited(plant, "JOG") > before)
    assert audited(plant, "JOG") <= before + presses


def test_a_touch_that_scrolls_or_only_taps_moves_nothing(open_page, plant):
    page = open_page(ARM, drawn=False, width=360, height=740)
    ready(page)
    panel = region(page, "Tool")
    button(panel, "Jog").click()
    plus = button(panel, "Tool Z +")
    page.evaluate(STEPS)
    for kind in (TOUCH, PEN):
        hand = Hand(page, kind)
        for gesture in (scroll, tap):
            for _ in range(40):
                plus.evaluate("each => each.scrollIntoView({block: 'center'})")
                page.wait_for_timeout(600)  # a control that has just moved ignores presses
                before, at = audited(plant, "JOG"), page.evaluate("window.steps = [], scrollY")
                gesture(page, hand, *centre_of(plus))
                if page.evaluate("steps[1] - steps[0]") < REST_MS / 2:
                    break  # on a busy machine a gesture may rest first, and hold
            if (kind, gesture) == (TOUCH, scroll):
                wait_until(lambda at=at: page.evaluate("scrollY") > at + 50)
            page.wait_for_timeout(500)
            assert audited(plant, "JOG") == before
    button(page, "Release").click()


def scroll(page, hand, x, y):
    hand.press(x, y)
    for moved in range(20, 120, 5):
        hand.move(x, y - moved)
    page.wait_for_timeout(300)
    hand.lift()


def tap(_, hand, x, y):
    hand.press(x, y)
    hand.lift()


def test_a_hidden_page_ends_the_jog_and_control(jog_page):
    panel = region(jog_page, "Tool")
    minus = button(panel, "Base Z −")
    hand = Hand(jog_page, MOUSE)
    hand.press(*centre_of(minus))
    expect(panel.get_by_label("Outcome", exact=True)).to_contain_text(re.compile("Z −: [0-9]|Ended"))
    jog_page.evaluate(HIDE, True)
    hand.lift()
    notice = region(jog_page, "Control").get_by_label("Outcome", exact=True)
    expect(notice).to_contain_text("this page was hidden")
    jog_page.evaluate(HIDE, False)
    ready(jog_page)
