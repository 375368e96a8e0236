"""Actions on the program's page."""

import re

from playwright.sync_api import expect

PAGE = "#/program/test/arm"
# Runs until it is stopped, however slow the pages are.
WAITS = """home
wait 60
home
"""
CHECKED_MS = 40_000  # a busy machine's worker starts slowly


def write(page, text):
    field = page.get_by_role("textbox", name="Program text")
    expect(field).to_have_value(re.compile("move_joints"), timeout=CHECKED_MS)  # the example is there
    field.fill(text)
