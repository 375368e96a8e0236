"""Define's drafts: a late answer, or one from another tab, changes no other draft."""

import re
import shutil

import pytest
from playwright.sync_api import expect

from robots.descriptions.description import load
from tests.browser.conftest import NO_WEBGL
from tests.browser.define.page import (
    SHAPES,
    chain_row,
    choose,
    done,
    drawing,
    drop,
    field,
    held,
    opened,
    problems,
    refusal,
    save_state,
    settled,
    shape,
    tab,
    table_rows,
)
from tests.browser.robot_page import button

pytestmark = pytest.mark.browser


def go(page, name):
    page.evaluate("(name) => void (location.hash = `#/define/${name}`)", name)


def save_new(page, name, title):
    button(page, "Start empty").click()
    tab(page, "Robot")
    field(page, "name").fill(name)
    field(page, "title").fill(title)
    button(page, "Save").click()
    expect(save_state(page)).to_have_text("Saved")


@pytest.mark.long
def test_a_file_that_is_read_late_is_not_put_into_the_robot_opened_meanwhile(open_page):
    page = opened(open_page, "pt500")
    expect(drawing(page)).to_have_attribute("data-shapes", "6")
    with held(page, "**/define/mesh"):
        with page.expect_request("**/define/mesh"):
            drop(page, ("late.wrl", shape("base.wrl")[1]))
        go(page, "puma560")
        expect(table_rows(page)).to_have_count(6)
    # One drop is read after the other: once this one is there, the first is done with.
    drop(page, ("own.wrl", shape("base.wrl")[1]))
    expect(table_rows(page)).to_have_count(7)
    expect(chain_row(page, 6).get_by_role("button", name="own · own.wrl")).to_be_visible()
    button(page, "Undo").click()
    expect(save_state(page)).to_have_text("No changes")


@pytest.mark.long
def test_a_robot_that_is_answered_late_does_not_replace_the_one_opened_meanwhile(open_page):
    page = open_page("#/define", drawn=False)
    with held(page, "**/define/robots/pt500"):
        go(page, "pt500")
        expect(page.get_by_text("Loading…")).to_be_visible()
        go(page, "puma560")
        expect(table_rows(page)).to_have_count(6)
    settled(page)
    expect(table_rows(page)).to_have_count(6)


@pytest.mark.long
def test_two_shapes_chosen_in_a_row_are_both_kept(open_page):
    page = open_page("#/define")
    button(page, "Start empty").click()
    # Far from the server: the second is chosen long before the first is read.
    network = page.context.new_cdp_session(page)
    slow = {"offline": False, "latency": 1000, "downloadThroughput": -1, "uploadThroughput": -1}
    network.send("Network.enable")
    network.send("Network.emulateNetworkConditions", slow)
    for part, name in (("base", "base.wrl"), (0, "column.3ds")):
        choose(page, part)
        page.get_by_label("Choose a file…", exact=True).set_input_files(SHAPES / name)
    expect(drawing(page)).to_have_attribute("data-shapes", "2")


@pytest.mark.long
def test_a_save_that_is_answered_late_leaves_the_robot_opened_meanwhile_as_it_is(open_page, plant):
    page = open_page("#/define", drawn=False)
    button(page, "Start empty").click()
    tab(page, "Robot")
    field(page, "name").fill("slow")
    with held(page, "**/define/save"):
        button(page, "Save").click()
        expect(save_state(page)).to_have_text("Saving…")
        go(page, "pt500")
        expect(table_rows(page)).to_have_count(5)
    expect(done(page)).to_contain_text("slow is saved in")
    assert load(plant.robots / "slow").title == ""
    expect(page).to_have_url(f"{plant.address}/#/define/pt500")
    expect(save_state(page)).to_have_text("No changes")
    # The site does not have it: it must be saved first.
    expect(button(page, "Save and start simulated")).to_have_count(1)
    # A saved draft is no longer listed as unsaved.
    page.get_by_role("link", name="New", exact=True).click()
    expect(page.get_by_text("From link files")).to_be_visible()
    expect(page.get_by_role("button", name=re.compile("^Continue "))).to_have_count(0)


@pytest.mark.long
def test_what_somebody_else_saved_meanwhile_is_asked_about_and_ones_own_is_not(open_page, plant):
    page = open_page("#/define", drawn=False, refused=True)
    save_new(page, "shared", "First")
    field(page, "title").fill("Own")
    button(page, "Save").click()
    expect(save_state(page)).to_have_text("Saved")
    assert load(plant.robots / "shared").title == "Own"

    (plant.robots / "shared" / "README.md").write_text("Ours.")
    field(page, "title").fill("Mine")
    button(page, "Save").click()
    question = page.get_by_role("alertdialog")
    expect(question).to_contain_text("was changed after it was opened: a save over it loses these changes")
    assert load(plant.robots / "shared").title == "Own"
    button(page, "Cancel").click()
    # A question about one robot is no answer for another.
    button(page, "Save").click()
    field(page, "title").fill("Mine after all")
    button(page, "Save over it").click()
    expect(save_state(page)).to_have_text("Saved")
    assert load(plant.robots / "shared").title == "Mine after all"


def test_every_tab_has_a_new_draft_of_its_own_and_another_tab_offers_them_all(open_page, plant):
    first = open_page(drawn=False)

    def beside():
        page = first.context.new_page()
        page.add_init_script(NO_WEBGL)
        return page

    tabs = [first, beside()]
    for number, page in enumerate(tabs):
        page.goto(f"{plant.address}/#/define")
        button(page, "Start empty").click()
        tab(page, "Robot")
        field(page, "title").fill(f"Arm {number}")
    for number, page in enumerate(tabs):
        page.reload()
        expect(page.get_by_role("heading", level=1)).to_have_text(f"Arm {number}")
    other = beside()
    other.goto(f"{plant.address}/#/define")
    expect(other.get_by_role("button", name=re.compile("^Continue "))).to_have_count(2)
    other.get_by_role("button", name="Continue Arm 0").click()
    expect(other.get_by_role("heading", level=1)).to_have_text("Arm 0")


@pytest.mark.long
def test_a_shape_that_cannot_be_read_is_among_the_problems(open_page, plant):
    folder = plant.robots / "broken"
    folder.mkdir(parents=True)
    shutil.copytree(SHAPES, folder / "meshes")
    text = (SHAPES.parent / "robot.toml").read_text().replace('name = "pt500"', 'name = "broken"', 1)
    (folder / "robot.toml").write_text(text)
    (folder / "meshes" / "column.3ds").write_bytes(b"MM\x00")
    page = open_page("#/define/broken", drawn=False, refused=True)
    expect(problems(page)).to_have_count(1)
    expect(problems(page)).to_contain_text("column.3ds")
    problems(page).click()
    expect(field(page, "joint/0/link/mesh")).to_be_focused()
    expect(page.get_by_role("tabpanel").get_by_text(re.compile(r"^\S*column\.3ds: "))).to_have_count(1)
    field(page, "joint/0/d").fill("301")
    settled(page)
    expect(problems(page)).to_have_count(1)


@pytest.mark.long
def test_files_of_which_nothing_can_be_made_are_said(open_page):
    page = open_page("#/define", drawn=False, refused=True)
    drop(page, ("notes.txt", b"none"))
    expect(refusal(page)).to_have_text("There is no mesh file, URDF or zip among them.Dismiss")
    for name in ("part.off", "part.wrl.gz"):
        drop(page, (name, b"OFF\n0 0 0\n"))
        expect(refusal(page)).to_contain_text(f"{name}: ")
        expect(refusal(page)).to_contain_text("is not supported")
