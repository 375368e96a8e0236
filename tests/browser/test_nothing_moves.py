"""The controls that move a robot keep their places while messages come and go."""

import re
from contextlib import suppress

import pytest
from playwright.sync_api import Error, expect

from robomesh.schemas.robomesh_pb2 import Event
from tests.browser.robot_page import (
    ARM,
    alarm_band,
    button,
    control_notice,
    control_requests,
    joint_value,
    joint_values,
    joints_notice,
    ready,
    region,
    reset_stop,
    stop_button,
    stop_panel,
    who_controls,
)

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)
SIZES = [
    pytest.param(size, marks=[pytest.mark.long] * (size == (1024, 768)), id="{}x{}".format(*size))
    for size in ((1440, 900), (1024, 768), (360, 740))
]
# Left, top, width and height of every control that moves the robot, in the document.
PLACES = """() => Object.fromEntries([...document.querySelectorAll("[data-moves='true']")].map((each) => {
    const box = each.getBoundingClientRect();
    let left = box.left, top = box.top;
    for (let parent = each.parentElement; parent; parent = parent.parentElement) {
        left += parent.scrollLeft; top += parent.scrollTop;
    }
    const row = each.closest(".joint-row")?.querySelector(".joint-name").textContent;
    const name = each.getAttribute("aria-label") ?? row ?? each.textContent;
    return [name, [left, top, box.width, box.height].map(Math.round).join(" ")];
}))"""


@pytest.fixture(params=SIZES)
def page(request, open_page):
    """Yield a page of the arm, in control of it."""
    width, height = request.param
    page = open_page(ARM, width, height, drawn=False)
    ready(page)
    yield page
    button(page, "Release").click()
    expect(who_controls(page)).to_have_text("Nobody is in control")


def test_controls_keep_their_places_while_messages_come_and_go(page, open_page):
    before = page.evaluate(PLACES)
    assert len(before) >= 12
    bob = open_page(ARM, drawn=False)
    bob.get_by_label("Your name").fill("bob")
    button(bob, "Ask for control").click()
    bob.get_by_label("Reason").fill("the gripper must be changed before the next shift begins, please")
    bob.get_by_label("Reason").press("Enter")
    expect(control_requests(page)).to_contain_text("bob asks for control")
    assert page.evaluate(PLACES) == before
    page.get_by_role("button", name=re.compile("^Record")).first.click()
    expect(region(page, "Record…")).to_be_visible()
    assert page.evaluate(PLACES) == before
    page.get_by_role("button", name=re.compile("^Record")).first.click()
    button(page, "Note…").click()
    expect(page.get_by_role("form", name="Note")).to_be_visible()
    assert page.evaluate(PLACES) == before
    button(page, "Note…").click()
    # A refusal of several lines, with its cause.
    field = page.get_by_label("Type a target of waist", exact=True)
    for _ in range(20):
        page.get_by_label(re.compile("^Type a target of waist: ")).click()
        # While states are late on a busy machine, no target can be typed.
        with suppress(Error):
            field.fill("179", timeout=3000)
            break
    page.keyboard.press("Enter")
    expect(joints_notice(page)).to_contain_text("Not sent")
    assert page.evaluate(PLACES) == before


def test_controls_keep_their_places_when_stopped_and_without_a_connection(page):
    before = page.evaluate(PLACES)
    stop_button(page).click()
    expect(stop_panel(page)).to_be_visible()
    stopped = page.evaluate(PLACES)
    assert stopped == {name: place for name, place in before.items() if name in stopped}
    reset_stop(page)
    assert page.evaluate(PLACES) == before


def test_a_press_on_a_control_that_has_just_moved_is_ignored(page):
    step = page.get_by_role("button", name="waist +1°")
    push = """(px) => {
        document.querySelector(".joints").style.marginTop = `${px}px`;
        const box = document.querySelector(".step").getBoundingClientRect();
        return [box.left + box.width / 2, box.top + box.height / 2];
    }"""
    step.evaluate("each => each.scrollIntoView({block: 'center'})")  # not under STOP
    page.wait_for_timeout(600)
    waist = joint_value(page, "waist")
    at_rest = waist.inner_text()
    x, y = page.evaluate(push, 30)
    page.mouse.click(x, y)
    expect(control_notice(page)).to_contain_text("Not sent: the page had moved this button")
    page.evaluate(push, 0)
    page.wait_for_timeout(600)
    assert waist.inner_text() == at_rest
    for _ in range(5):  # a busy page may settle late
        step.click()
        with suppress(AssertionError):
            expect(waist).not_to_have_text(at_rest, timeout=5000)
            break
    expect(waist).not_to_have_text(at_rest)


@pytest.mark.parametrize("size", SIZES)
def test_an_alarm_moves_no_control(open_page, raised, size):
    page = open_page(ARM, *size, drawn=False)
    expect(joint_values(page)).to_have_count(5)
    raised("kinematics.stop", "the arm is at the fence", severity=Event.CRITICAL)
    band = alarm_band(page)
    expect(band).to_contain_text("the arm is at the fence")
    with_alarm = page.evaluate(PLACES)
    assert len(with_alarm) >= 12
    button(band, "Dismiss").click()
    expect(band).to_have_count(0)
    assert page.evaluate(PLACES) == with_alarm
