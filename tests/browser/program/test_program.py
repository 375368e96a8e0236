"""The program's page on a real site: written, taught, checked, run; and refused if it collides."""

import json
import re

import pytest
from playwright.sync_api import expect

from tests.browser.program.page import CHECKED_MS, PAGE, WAITS, progress, run_button, violations, write
from tests.browser.robot_page import (
    button,
    region,
    scene,
    serious,
    state_word,
    stop_button,
    take,
)

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


def verdict(page, ok):
    said = region(page, "Check").get_by_role("status")
    expect(said).to_have_attribute("aria-busy", "false", timeout=CHECKED_MS)
    expect(said).to_have_attribute("data-ok", str(ok).lower())


def positions(plant):
    """Return the arm's joint positions from the mesh."""
    state = json.loads(plant.site.command("monitor", "arm", "--json", "--count", "1").stdout)
    return state["joints"]


def test_a_program_that_is_typed_is_checked_and_its_motion_is_shown_as_a_ghost(open_page):
    page = open_page(PAGE)
    write(page, FREE)
    verdict(page, ok=True)
    assumed = region(page, "Check").get_by_text("jerk-limited")
    expect(assumed).to_be_hidden()
    page.get_by_text("What is assumed").click()
    expect(assumed).to_be_visible()
    expect(scene(page)).to_have_attribute("data-loaded", "true")
    page.get_by_role("slider", name="Moment of the checked motion").fill("1")
    expect(region(page, "Checked motion").get_by_text(re.compile(r"^line \d"))).to_be_visible()
    expect(scene(page)).to_have_attribute("data-ghost", re.compile("[^0]"))


@pytest.mark.long
def test_a_program_that_collides_leads_to_its_line_and_the_gateway_refuses_it_and_nothing_moves(
    open_page, plant
):
    page = open_page(PAGE, drawn=False)
    write(page, COLLIDES)
    verdict(page, ok=False)
    row = violations(page).filter(has_text="Collision").first
    expect(row).to_contain_text("post")
    expect(row).to_contain_text("line 4")
    row.click()
    field = page.get_by_role("textbox", name="Program text")
    assert field.evaluate("field => field.value.slice(field.selectionStart, field.selectionEnd)") == (
        "move_joints 60 90 -90 0 0"
    )
    expect(region(page, "Checked motion").get_by_text(re.compile("^line 4"))).to_be_visible()
    before = positions(plant)
    take(page)
    run_button(page).click()
    expect(region(page, "Run").get_by_role("alert")).to_contain_text("post", timeout=CHECKED_MS)
    assert positions(plant) == pytest.approx(before, abs=1e-6)
    field.fill(FREE)  # of which the refusal says nothing
    expect(region(page, "Run").get_by_role("alert")).to_have_count(0)
    button(page, "Release").click()


def expect_progress(page, outcome, name):
    expect(progress(page)).to_contain_text(re.compile(f"^{outcome}.*{name}"), timeout=CHECKED_MS)


def test_a_program_that_runs_is_held_and_stopped_and_everybody_sees_how_far_it_is(open_page):
    page, other = open_page(PAGE, drawn=False), open_page(PAGE, drawn=False)
    write(page, WAITS)
    page.get_by_label("Program name").fill("waits")
    verdict(page, ok=True)
    take(page)
    run_button(page).click()
    for seen in (page, other):
        expect_progress(seen, "Running", "waits")
        expect(progress(seen)).to_contain_text("left of 01:0", timeout=CHECKED_MS)
        expect(state_word(seen)).to_have_text("Running · waits 60\u202fs")
    expect(page.get_by_text("▶", exact=True)).to_have_count(1, timeout=CHECKED_MS)
    button(page, "Hold").click()
    for seen in (page, other):
        expect(state_word(seen)).to_have_text("Holding")
    stop_button(page).click()
    for seen in (page, other):
        expect_progress(seen, "Ended early", "stopped by li")
    page.get_by_role("button", name=re.compile("Reset stop")).click(timeout=CHECKED_MS)
    expect(page.get_by_role("button", name=re.compile("Reset stop"))).to_have_count(0, timeout=CHECKED_MS)
    button(page, "Release").click()


@pytest.mark.long
def test_a_phone_shows_programs_in_one_column_and_axe_finds_nothing_serious(open_page):
    page = open_page("#/program", width=360, height=740, has_touch=True, drawn=False)
    robot = page.get_by_role("main").get_by_role("link")
    point = page.get_by_role("list", name="Points").get_by_role("listitem")
    for path, there in (("#/program", robot), (PAGE, point)):
        page.evaluate("path => (location.hash = path)", path)
        expect(there.first).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth") == 360
        small = page.evaluate(
            """[...document.querySelectorAll("main button, main a, main input:not([type=file])")]
               .map((each) => [each.outerHTML.slice(0, 80), each.getBoundingClientRect().height])
               .filter(([, height]) => height > 0 && height < 44)"""
        )
        assert small == []
        assert serious(page) == []


@pytest.mark.long
def test_on_a_desk_only_lists_of_a_program_scroll_and_axe_finds_nothing_serious(open_page):
    page = open_page(PAGE, drawn=False)
    write(page, COLLIDES)
    violations(page).first.click(timeout=CHECKED_MS)
    button(page, "Pose a ghost").click()
    button(page, "pose").click()
    assert page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]") == [
        1440,
        900,
    ]
    assert serious(page) == []
    button(page, "Light").click()
    assert serious(page) == []
