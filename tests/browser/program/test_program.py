"""The program's page on a real site: written, taught, checked, run; and refused if it collides."""

import json
import re

import pytest
from playwright.sync_api import expect

from tests.browser.program.page import CHECKED_MS, PAGE, WAITS, write
from tests.browser.robot_page import button, control_notice, serious, stop_button, take

pytestmark = pytest.mark.browser

FREE = """home
move_joints -20 90 -90 0 0
wait 0.2
move_joints 0 90 -90 0 0
"""
COLLIDES = """home
speed 50
# through the post
move_joints 60 90 -90 0 0
"""
# 28 mm from the post, within the warning distance: on three lines, with one cause.
NEAR = """home
move_joints 14 90 -90 0 0
wait 0.2
move_joints 0 90 -90 0 0
"""


def verdict(page, ok):
    expect(page.locator(f'.verdict[data-ok="{str(ok).lower()}"][data-busy="false"]')).to_be_visible(
        timeout=CHECKED_MS
    )


def positions(plant):
    """Return the arm's joint positions from the mesh."""
    state = json.loads(plant.site.command("monitor", "arm", "--json", "--count", "1").stdout)
    return state["joints"]


def test_a_program_that_is_typed_is_checked_and_its_motion_is_shown_as_a_ghost(open_page):
    page = open_page(PAGE)
    write(page, FREE)
    verdict(page, ok=True)
    assumed = page.locator(".assumed p")
    expect(assumed).to_be_hidden()
    page.get_by_text("What is assumed").click()
    expect(assumed).to_be_visible()
    expect(assumed).to_contain_text("jerk-limited")
    page.wait_for_selector('canvas[data-loaded="true"]')
    page.get_by_role("slider", name="Moment of the checked motion").fill("1")
    expect(page.locator(".scrub-words")).to_contain_text("line")
    page.wait_for_selector('.canvas-place canvas:not([data-ghost="0"])[data-ghost]')
    write_wrong = FREE.replace("wait 0.2", "wiat 0.2")
    page.get_by_role("textbox", name="Program text").fill(write_wrong)
    row = page.locator(".violation")
    expect(row).to_contain_text("line 3", timeout=CHECKED_MS)
    expect(row).to_contain_text("wiat")
    expect(page.locator(".run-panel .notice")).to_contain_text("Cannot run: line 3")
    expect(page.locator("button.run")).to_be_disabled()


def test_a_program_that_collides_leads_to_its_line_and_the_gateway_refuses_it_and_nothing_moves(
    open_page, plant
):
    page = open_page(PAGE, drawn=False)
    write(page, COLLIDES)
    verdict(page, ok=False)
    row = page.locator('.violation[data-kind="collision"]').first
    expect(row).to_contain_text("post")
    expect(row).to_contain_text("line 4")
    row.click()
    field = page.get_by_role("textbox", name="Program text")
    assert field.evaluate("field => field.value.slice(field.selectionStart, field.selectionEnd)") == (
        "move_joints 60 90 -90 0 0"
    )
    expect(page.locator(".scrub-words")).to_contain_text("line 4")
    before = positions(plant)
    take(page)
    page.locator("button.run").click()
    expect(page.locator(".run-panel .notice.refused")).to_contain_text("post", timeout=CHECKED_MS)
    assert positions(plant) == pytest.approx(before, abs=1e-6)
    field.fill(FREE)  # of which the refusal says nothing
    expect(page.locator(".run-panel .notice.refused")).to_have_count(0)
    button(page, "Release").click()


def progress(seen, outcome, name):
    expect(seen.locator(f'.progress[data-outcome="{outcome}"]')).to_contain_text(name, timeout=CHECKED_MS)


def test_a_program_runs_or_is_stopped_and_everybody_sees_how_far_it_is_and_what_to_mind(open_page):
    page, other = open_page(PAGE, drawn=False), open_page(PAGE, drawn=False)
    write(page, NEAR)
    verdict(page, ok=True)
    rows = page.locator(".violation")
    expect(rows.filter(has_text="arm/forearm comes within")).to_have_count(1)
    expect(rows.first).to_contain_text("lines 2 to 4")
    page.get_by_label("Program name").fill("to and fro")
    take(page)
    page.locator("button.run").click()
    for seen in (page, other):
        progress(seen, "DONE", "to and fro")
    page.evaluate("location.hash = '#/test/arm'")
    for key in ("PageUp", *["ArrowUp"] * 3, "Enter"):
        page.get_by_role("slider", name="Target of waist").press(key)
    expect(page.locator(".joints .notice-warning")).to_contain_text("post", timeout=CHECKED_MS)
    page.evaluate(f"location.hash = '{PAGE}'")
    page.get_by_role("textbox", name="Program text").fill(WAITS)
    page.get_by_label("Program name").fill("waits")
    verdict(page, ok=True)
    page.locator("button.run").click()
    for seen in (page, other):
        progress(seen, "RUNNING", "waits")
        expect(seen.locator(".progress-line")).to_contain_text("left of 01:0", timeout=CHECKED_MS)
        expect(seen.locator(".headline .state.motion")).to_have_text("Running · waits 60\u202fs")
    expect(page.locator(".editor-band.running")).to_have_count(1, timeout=CHECKED_MS)
    # Only what the gateway would accept can be pressed.
    expect(control_notice(page)).to_contain_text("A program runs")
    for refused in (button(page, "Home"), page.get_by_label("Speed"), page.locator("button.run")):
        expect(refused).to_be_disabled()
    expect(button(page, "Hold")).to_be_enabled()
    for path, place in (("/", ".tile"), ("/wall/test/arm/close", ".wall-tile"), ("/test/arm", ".headline")):
        other.evaluate("path => (location.hash = path)", path)
        expect(other.locator(f"{place} .state.motion")).to_have_text("Running · waits 60\u202fs")
    expect(other.locator(".program-line")).to_contain_text("left")
    other.evaluate(f"location.hash = '{PAGE}'")
    button(page, "Hold").click()
    for seen in (page, other):
        expect(seen.locator(".headline .state.warning")).to_have_text("Holding")
    expect(control_notice(page)).to_contain_text("Resume first")
    expect(button(page, "Resume")).to_be_enabled()
    stop_button(page).click()
    for seen in (page, other):
        progress(seen, "ENDED", "stopped by li")
    page.get_by_role("button", name=re.compile("Reset stop")).click(timeout=CHECKED_MS)
    expect(page.get_by_role("button", name=re.compile("Reset stop"))).to_have_count(0, timeout=CHECKED_MS)
    button(page, "Release").click()


def test_points_are_taught_named_shown_and_taken_back_and_the_draft_outlives_a_reload(open_page):
    page = open_page(PAGE, drawn=False)
    write(page, "# mine\nhome\n")
    field = page.get_by_role("textbox", name="Program text")
    field.press("Control+End")
    button(page, "Add where the robot is").click()
    expect(field).to_have_value(re.compile(r"^# mine\npoint p1 = joints [-\d. ]+\nhome\nmove_joints p1$"))
    button(page, "Pose a ghost").click()
    handle = page.get_by_role("slider", name="waist of the ghost")
    handle.press("PageUp")
    button(page, "Add this pose").click()
    expect(page.locator(".points li")).to_have_count(2)
    page.get_by_role("button", name="Rename p2").click()
    page.get_by_role("textbox", name="Rename p2").fill("part")
    page.get_by_role("textbox", name="Rename p2").press("Enter")
    expect(field).to_have_value(re.compile("move_joints part"))
    page.get_by_role("button", name="Delete part").click()
    expect(page.locator(".teach")).to_contain_text("still used in line")
    button(page, "Undo").click()
    expect(page.locator('[data-point="part"]')).to_be_visible()
    kept = field.input_value()
    page.reload()
    expect(field).to_have_value(kept)
    page.evaluate("location.hash = '#/program/test/nobody'")
    page.wait_for_selector(".missing")
    page.evaluate(f"location.hash = '{PAGE}'")
    expect(field).to_have_value(kept)
    field.press("Control+End")
    field.type("# more")
    page.reload()
    expect(field).to_have_value(f"{kept}# more")


def test_a_phone_shows_programs_in_one_column_and_axe_finds_nothing_serious(open_page):
    page = open_page("#/program", width=360, height=740, has_touch=True, drawn=False)
    for path, there in (("#/program", ".program-choose a"), (PAGE, ".points li")):
        page.evaluate("path => (location.hash = path)", path)
        page.wait_for_selector(there)
        assert page.evaluate("document.documentElement.scrollWidth") == 360
        small = page.evaluate(
            """[...document.querySelectorAll("main button, main a, main input:not([type=file])")]
               .map((each) => [each.outerHTML.slice(0, 80), each.getBoundingClientRect().height])
               .filter(([, height]) => height > 0 && height < 44)"""
        )
        assert small == []
        assert serious(page) == []


def test_on_a_desk_only_lists_of_a_program_scroll_and_axe_finds_nothing_serious(open_page):
    page = open_page(PAGE, drawn=False)
    write(page, COLLIDES)
    page.locator(".violation").first.click(timeout=CHECKED_MS)
    button(page, "Pose a ghost").click()
    button(page, "pose").click()
    assert page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]") == [
        1440,
        900,
    ]
    assert serious(page) == []
    button(page, "Light").click()
    assert serious(page) == []
