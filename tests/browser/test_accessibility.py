"""Every page, dark and light: axe finds nothing serious; in Chinese nothing of the page itself is English."""

import pytest
from playwright.sync_api import expect

from robomesh.schemas import robomesh_pb2 as schema
from tests.browser.robot_page import alarms, keep_picture, serious, visit

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)

PICTURED = {
    "#/": "fleet",
    "#/hall/arm": "robot-without-3d",
    "#/wall": "wall",
    "#/recordings": "recordings-empty",
    "#/program": "programs",
    "#/program/hall/arm": "program",
    "#/hall/nowhere": "no-such-robot",
    "#/events": "events",
    "#/settings": "settings",
}
# Check that servers' texts are marked with their own language.
ENGLISH = """
const own = (node) => {
  for (let at = node.parentElement; at; at = at.parentElement) if (at.lang === "en") return false;
  return !node.parentElement.closest("script, noscript, style, option, code, pre, textarea");
};
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
const found = [];
for (let node = walker.nextNode(); node; node = walker.nextNode())
  if (/[A-Za-z]{2,} [a-z]{2,} [a-z]{2,}/.test(node.data) && own(node)) found.push(node.data.trim());
found
"""


@pytest.fixture
def alarmed(raised):
    """Raise an alarm for the page to show."""
    raised("joints.gone", "no positions come from it")
    yield
    raised("joints.back", "positions come again", schema.Event.INFO)


@pytest.mark.parametrize(("theme", "language"), [("dark", "en"), ("light", "zh")])
def test_axe_finds_nothing_serious_on_any_page_and_a_chinese_page_is_chinese(
    open_page, alarmed, theme, language
):
    kept = f"localStorage['robomesh.theme'] = '{theme}'; localStorage['robomesh.language'] = '{language}';"
    page = open_page(drawn=False, script=kept)
    page.wait_for_function("language => document.documentElement.lang.startsWith(language)", arg=language)
    assert page.evaluate("document.documentElement.dataset.theme") == theme
    found = {}
    for path, name in PICTURED.items():
        visit(page, path)
        if path == "#/events":
            expect(alarms(page)).not_to_have_count(0)
        found[path] = serious(page)
        if language == "en":
            keep_picture(page, name)
        if (headings := page.get_by_role("heading", level=1).count()) != 1:
            found[path] += [f"{headings} headings of the first level"]
        if language == "zh":
            found[path] += page.evaluate(ENGLISH)
    assert found == {path: [] for path in PICTURED}


def test_the_first_stop_of_the_tab_key_skips_the_bar(open_page):
    page = open_page(drawn=False)
    visit(page, "#/settings")
    page.keyboard.press("Tab")
    skip = page.get_by_role("button", name="Skip to the page")
    expect(skip).to_be_focused()
    expect(skip).to_be_in_viewport()
    page.keyboard.press("Enter")
    expect(page.get_by_role("main")).to_be_focused()
    expect(skip).not_to_be_in_viewport()
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.closest('main') !== null")
