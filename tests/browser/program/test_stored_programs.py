"""Stored programs on the page of a real site: saved, compared, restored, and seen by another page."""

import pytest
from playwright.sync_api import expect

from tests.browser.program.page import PAGE, write
from tests.browser.robot_page import (
    button,
    region,
    serious,
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
