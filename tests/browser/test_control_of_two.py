"""Two browsers before one robot: how control goes from one to the other, and keys on steps."""

import re
from functools import partial

import pytest
from playwright.sync_api import Error, expect

from tests.browser.robot_page import (
    ARM,
    answer,
    audited,
    button,
    clear_stop,
    control_notice,
    control_requests,
    degrees,
    joint_value,
    move_slowly,
    ready,
    region,
    reset_stop,
    serious,
    state_word,
    stop_panel,
    take,
    who_controls,
)

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)


@pytest.fixture
def open_arm(open_page):
    return partial(open_page, ARM, drawn=False)


def ask(page, name, reason=""):
    page.get_by_label("Your name").fill(name)
    button(page, "Ask for control").click()
    page.get_by_label("Reason").fill(reason)
    page.get_by_label("Reason").press("Enter")
    expect(control_notice(page)).to_contain_text("is told that you ask")


def take_over(page, name, loser, reason):
    page.get_by_label("Your name").fill(name)
    button(page, "Take over…").click()
    page.get_by_label("Reason").fill(reason)
    button(page, f"Take over from {loser}").click()


def test_one_asks_and_is_handed_control(open_arm):
    alice, bob, carol = open_arm(), open_arm(), open_arm(width=360, height=740)
    take(alice, "alice")
    expect(region(carol, "Control").get_by_text(re.compile("^since "))).to_have_text(
        re.compile(r"since \d\d:\d\d:\d\d[+-]\d\d:\d\d")
    )
    ask(bob, "bob", "the gripper must be changed")
    for page in (alice, carol):
        expect(control_requests(page)).to_have_text(
            re.compile("^bob asks for control: “the gripper must be changed”")
        )
    assert control_requests(carol).get_by_role("button").count() == 0
    assert serious(alice, ".wish") == []
    answer(alice, "Hand over to bob")
    expect(control_requests(alice)).to_contain_text("you are in control until bob accepts")
    expect(control_requests(carol)).to_have_text("alice offers control to bob.")
    expect(control_requests(bob)).to_contain_text("alice offers you control.")
    assert serious(bob) == []
    answer(bob, "Accept")
    expect(who_controls(bob)).to_have_text("You are in control")
    expect(who_controls(alice)).to_have_text("bob is in control")
    expect(control_notice(alice)).to_have_text("bob has accepted control.")
    expect(button(alice, "Home")).to_be_disabled()
    button(bob, "Release").click()


def test_taking_over_needs_a_reason_which_the_loser_is_told(open_arm):
    alice, bob = open_arm(), open_arm()
    take(alice, "alice")
    bob.get_by_label("Your name").fill("bob")
    button(bob, "Take over…").click()
    expect(bob.get_by_role("form", name="Take over from alice")).to_contain_text(
        "alice loses control at once"
    )
    expect(button(bob, "Take over from alice")).to_be_disabled()
    assert serious(bob) == []
    bob.keyboard.press("Escape")
    expect(button(bob, "Take over…")).to_be_focused()
    take_over(bob, "bob", "alice", "smoke at the gripper")
    expect(who_controls(bob)).to_have_text("You are in control")
    expect(control_notice(alice)).to_have_text("Control ended: taken by bob: smoke at the gripper")
    expect(who_controls(alice)).to_have_text("bob is in control")
    assert serious(alice) == []
    button(bob, "Release").click()


def test_a_killed_browser_loses_control_at_once_and_its_motion_is_stopped(open_arm):
    alice, bob = open_arm(), open_arm()
    ready(alice, "alice")
    move_slowly(alice)
    with pytest.raises(Error, match="crash"):
        alice.goto("chrome://crash")
    # Because its session is lost: its lease would have ended too, but later, and for another reason.
    expect(stop_panel(bob)).to_contain_text("alice's page or program has disconnected")
    expect(who_controls(bob)).to_have_text("Nobody is in control")
    expect(state_word(bob)).to_have_text("Stopped")
    take(bob, "bob")
    clear_stop(bob)


@pytest.mark.long
def test_a_key_that_is_held_down_is_one_step(open_arm, plant):
    page = open_arm()
    ready(page)
    moves, waist = audited(plant, "MOVE_RELATIVE"), degrees(page, "waist")
    button(page, "waist +1°").focus()
    for _ in range(5):
        page.keyboard.down("Enter")
    page.keyboard.up("Enter")
    expect(joint_value(page, "waist")).to_have_text(f"{waist + 1:.2f}°")
    expect(state_word(page)).to_have_text("Idle")
    assert audited(plant, "MOVE_RELATIVE") == moves + 1


def test_space_on_a_step_button_stops_and_steps_nothing(open_arm, plant):
    page = open_arm()
    ready(page)
    moves = audited(plant, "MOVE_RELATIVE")
    button(page, "waist +1°").focus()
    page.keyboard.press("Space")
    expect(state_word(page)).to_have_text("Stopped")
    expect(button(page, "waist +1°")).to_be_disabled()
    assert audited(plant, "MOVE_RELATIVE") == moves
    reset_stop(page)
    expect(button(page, "waist +1°")).to_be_enabled()
