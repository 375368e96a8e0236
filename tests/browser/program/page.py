"""Actions on the program's page."""

import re

from playwright.sync_api import expect

from tests.browser.robot_page import region

PAGE = "#/program/test/arm"
# Runs until it is stopped, however slow the pages are.
WAITS = """home
wait 60
home
"""
CHECKED_MS = 40_000  # a busy machine's worker starts slowly


def violations(page):
    return page.get_by_role("list", name="Violations", exact=True).get_by_role("button")


def run_button(page):
    return region(page, "Run").get_by_role("button")


def progress(page):
    """Return how far the program is that runs, or how it ended."""
    return page.get_by_role("group", name="Progress", exact=True)


def write(page, text):
    field = page.get_by_role("textbox", name="Program text")
    expect(field).to_have_value(re.compile("move_joints"), timeout=CHECKED_MS)  # the example is there
    field.fill(text)
