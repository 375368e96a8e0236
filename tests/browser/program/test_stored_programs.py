"""Stored programs on the page of a real site: saved, compared, restored, and seen by another page."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.program.page import CHECKED_MS, PAGE, WAITS, progress, run_button, write
from tests.browser.robot_page import (
    button,
    journal_entry,
    journal_lines,
    region,
    serious,
    stop_button,
    take,
)

pytestmark = pytest.mark.browser

STORED_MS = 20_000


def text_of(page):
    return page.get_by_role("textbox", name="Program text")


def line(page, text):
    expect(page.get_by_label("Saved state", exact=True)).to_contain_text(text, timeout=STORED_MS)


def named(page, name):
    page.get_by_role("textbox", name="Program name").fill(name)


def save(page, version):
    button(page, "Save").click()
    line(page, f"Saved: version {version}")


def open_stored(page, name):
    button(page, "Programs").click()
    button(page, f"Open {name}").click()


def test_a_program_that_one_page_saves_is_opened_changed_and_restored_by_another(open_page):
    page, other = open_page(PAGE, drawn=False), open_page(PAGE, drawn=False)
    write(page, "home\nwait 1\n")
    line(page, "Never saved")
    named(page, "pick")
    save(page, 1)
    open_stored(other, "pick")
    expect(text_of(other)).to_have_value("home\nwait 1\n")
    text_of(other).fill("home\nwait 2\n")
    line(other, "Unsaved changes since version 1")
    save(other, 2)
    line(page, "saved version 2")
    button(page, "Compare").click()
    difference = page.get_by_role("region", name="Difference")
    expect(difference.get_by_role("deletion")).to_contain_text("wait 1")
    expect(difference.get_by_role("insertion")).to_contain_text("wait 2")
    button(page, "side by side").click()
    expect(difference.get_by_role("insertion")).to_contain_text("wait 2")
    page.get_by_role("list", name="Versions of pick").get_by_role("button").last.click()
    button(page, "Restore version 1").click()
    line(page, "Version 1 is restored as version 3")
    line(other, "saved version 3")
    button(page, "Rename").click()
    page.get_by_role("textbox", name="New name").fill("place")
    page.get_by_role("textbox", name="New name").press("Enter")
    expect(region(page, "Programs").get_by_role("heading", level=3)).to_have_text("place", timeout=STORED_MS)
    button(page, "Delete").click()
    page.get_by_role("form", name="Delete place").get_by_role("textbox").fill("not used")
    page.get_by_role("form", name="Delete place").get_by_role("button", name="Delete").click()
    line(other, "deleted this program: not used")
    button(page, "Deleted too").click()
    button(page, "Versions of place").click()
    page.get_by_role("list", name="Versions of place").get_by_role("button").nth(2).click()
    button(page, "Restore version 3").click()
    line(page, "restored as version 6")


@pytest.mark.long
def test_two_people_who_save_at_the_same_time_lose_nothing_and_the_second_decides(open_page):
    page, other = open_page(PAGE, drawn=False), open_page(PAGE, drawn=False)
    write(page, "home\n")
    named(page, "both")
    save(page, 1)
    open_stored(other, "both")
    expect(text_of(other)).to_have_value("home\n")
    text_of(page).fill("home\nwait 1\n")
    text_of(other).fill("home\nwait 2\n")
    save(page, 2)
    button(other, "Save").click()
    expect(other.get_by_text("Two people changed “both”")).to_be_visible(timeout=STORED_MS)
    difference = other.get_by_role("region", name="Difference")
    expect(difference.get_by_role("deletion")).to_contain_text("wait 1")
    expect(difference.get_by_role("insertion")).to_contain_text("wait 2")
    button(other, "Make mine current").click()
    line(other, "Version 3 is restored as version 4")
    expect(text_of(other)).to_have_value("home\nwait 2\n")
    line(page, "saved version 4")


@pytest.mark.long
def test_a_draft_that_was_never_saved_and_one_with_changes_outlive_a_reload_and_are_not_lost_by_opening(
    open_page,
):
    page = open_page(PAGE, drawn=False)
    write(page, "# mine\n")
    page.reload()
    expect(text_of(page)).to_have_value("# mine\n")
    line(page, "Never saved")
    named(page, "kept")
    save(page, 1)
    button(page, "New").click()
    expect(text_of(page)).to_have_value(re.compile("move_joints"))
    text_of(page).fill("# another\n")
    open_stored(page, "kept")
    button(page, "Open instead").click()
    expect(text_of(page)).to_have_value("# mine\n")
    button(page, "Undo").click()
    expect(text_of(page)).to_have_value("# another\n")
    button(page, "Redo").click()
    text_of(page).press("Control+End")
    text_of(page).type("home\n")
    line(page, "Unsaved changes since version 1")
    page.reload()
    expect(text_of(page)).to_have_value("# mine\nhome\n")
    line(page, "Unsaved changes since version 1")
    text_of(page).press("Control+s")
    line(page, "Saved: version 2")


@pytest.mark.long
def test_files_are_imported_as_programs_and_a_version_is_exported_byte_for_byte(open_page, tmp_path):
    page = open_page(PAGE, drawn=False)
    button(page, "Programs").click()
    expect(button(page, "Import files…")).to_be_enabled(timeout=STORED_MS)
    (tmp_path / "Größe.prog").write_text("home # ü\n", "utf-8")
    (tmp_path / "big.prog").write_text("#" * 70_000)
    for name, said in (("Größe.prog", "Größe: version 1 imported"), ("big.prog", "more than 64 KiB")):
        page.get_by_label("Import files…").set_input_files(tmp_path / name)
        line(page, said)
    button(page, "Versions of Größe").click()
    with page.expect_download() as download:
        button(page, "Export file").click()
    download.value.save_as(tmp_path / "out")
    assert download.value.suggested_filename == "Größe.prog"
    assert (tmp_path / "out").read_bytes() == "home # ü\n".encode()


@pytest.mark.long
def test_an_audit_entry_opens_the_text_that_ran_although_it_was_never_saved(open_page):
    page = open_page(PAGE, drawn=False)
    write(page, WAITS)
    named(page, "unsaved run")
    take(page)
    run_button(page).click()
    expect(progress(page)).to_contain_text(re.compile("^Running.*unsaved run"), timeout=CHECKED_MS)
    stop_button(page).click()
    expect(progress(page)).to_contain_text("Ended early", timeout=CHECKED_MS)
    page.get_by_role("button", name=re.compile("Reset stop")).click(timeout=CHECKED_MS)
    page.evaluate("location.hash = '#/events'")
    button(page, "Requests").click()
    journal_lines(page).filter(has_text="unsaved run", has_not_text="ended").first.click()
    journal_entry(page).get_by_role("link").click()
    expect(page.get_by_role("group", name="Difference")).to_have_text(WAITS.strip(), timeout=STORED_MS)
    expect(region(page, "Programs").get_by_role("heading", level=3)).to_contain_text("unsaved run")
    region(page, "Programs").get_by_role("button", name="Open in the editor").click()
    expect(text_of(page)).to_have_value(WAITS)


@pytest.mark.long
def test_a_phone_shows_stored_programs_and_axe_finds_nothing_serious(open_page):
    page = open_page(PAGE, width=360, height=740, has_touch=True, drawn=False)
    write(page, "home\n")
    named(page, "phone")
    save(page, 1)
    text_of(page).fill("wait 1\n")
    save(page, 2)
    for open_next in ("Programs", "Versions of phone"):
        button(page, open_next).click()
        expect(region(page, "Programs")).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth") == 360
        assert serious(page) == []


def test_a_layout_saved_under_a_name_opens_on_another_machine(open_page):
    robot = PAGE.replace("#/program/", "#/")
    page, other = open_page(robot, drawn=False), open_page(robot, drawn=False, width=360, height=740)
    page.get_by_label("Your name").fill("li")
    button(page, "Layout…").click()
    page.get_by_role("checkbox", name="Video").uncheck()
    form = page.get_by_role("form", name=re.compile("^Layouts saved at"))
    form.get_by_label("Name").fill("night")
    button(form, "Save layout").click()
    expect(form.get_by_role("status")).to_have_text("Saved: “night”.", timeout=STORED_MS)
    assert serious(page, ".layout-panel") == []

    button(other, "Layout…").click()
    theirs = other.get_by_role("form", name=re.compile("^Layouts saved at"))
    theirs.get_by_role("combobox").select_option("night")
    expect(other.get_by_role("checkbox", name="Video")).not_to_be_checked()
    assert other.evaluate("location.hash") == f"{robot}?hide=video"
    expect(theirs.get_by_role("status")).to_have_text(re.compile("^“night” was saved by li, "))
    assert other.evaluate("document.documentElement.scrollWidth") == 360

    page.get_by_role("checkbox", name="Plots").uncheck()
    expect(button(form, "Replace layout")).to_be_enabled()
    button(form, "Replace layout").click()
    expect(button(form, "Replace layout")).to_be_disabled(timeout=STORED_MS)
    for _ in range(100):  # the list may reach the other page later
        theirs.get_by_role("combobox").select_option("")
        theirs.get_by_role("combobox").select_option("night")
        if not other.get_by_role("checkbox", name="Plots").is_checked():
            break
        other.wait_for_timeout(100)
    expect(other.get_by_role("checkbox", name="Plots")).not_to_be_checked()
    button(form, "Delete…").click()
    button(form, "Delete “night”").click()
    expect(theirs.get_by_role("combobox").get_by_role("option")).to_have_text(["none yet"], timeout=STORED_MS)
