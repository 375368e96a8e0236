"""Layout of Define on a phone and a desktop, in both languages, for screen readers and the README."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import expect

from tests.browser.define.page import (
    choose,
    drawing,
    opened,
    robots,
    settled,
    tab,
    table,
)
from tests.browser.robot_page import button, keep_picture, serious

pytestmark = pytest.mark.browser

PICTURE = Path(__file__).resolve().parents[3] / "docs" / "define-page.png"
LARGEST_BYTES = 400_000


def go(page, path):
    page.evaluate("path => (location.hash = path)", path)
    expect(table(page).first).to_be_attached()


def small(page):
    """Return the controls that are too small for a thumb."""
    return page.evaluate(
        """[...document.querySelectorAll("main button, main a, main input:not([type=file]), main select")]
           .map((each) => [each.outerHTML.slice(0, 80), each.getBoundingClientRect().height])
           .filter(([, height]) => height > 0 && height < 44)"""
    )


def test_a_phone_shows_one_column_that_scrolls_one_way(open_page):
    page = open_page("#/define", width=360, height=740, drawn=False)
    expect(robots(page).first).to_be_attached()
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    assert small(page) == []
    go(page, "#/define/puma560")
    for name in ("Details", "Robot", "Frames", "Constraints", "Collisions", "Views"):
        tab(page, name)
        assert page.evaluate("document.documentElement.scrollWidth") == 360, name
    assert small(page) == []


@pytest.mark.long
def test_on_a_desk_only_lists_scroll(open_page):
    page = opened(open_page, "puma560", drawn=False)
    settled(page)
    for width, height in ((1440, 900), (1024, 768)):
        page.set_viewport_size({"width": width, "height": height})
        size = page.evaluate(
            """[document.documentElement.scrollWidth, document.documentElement.scrollHeight,
                document.body.scrollHeight]"""
        )
        assert size == [width, height, height]


@pytest.mark.long
def test_axe_finds_nothing_serious_in_define_which_speaks_chinese(open_page):
    page = open_page("#/define", drawn=False)
    expect(robots(page).first).to_be_attached()
    found = {"start": serious(page)}
    keep_picture(page, "define-start")
    button(page, "Light").click()
    found["start, light"] = serious(page)
    go(page, "#/define/pt500")
    for colours in ("light", "dark"):
        for name in ("Robot", "Frames", "Collisions", "Views", "Details"):
            tab(page, name)
            if name == "Details":
                choose(page, 1)
            found[f"{name}, {colours}"] = serious(page)
        if colours == "light":
            button(page, "Dark").click()
    button(page, "Paste a table…").click()
    page.get_by_role("dialog").get_by_role("textbox").fill("a (m)\td\tmin\tmax\n0,25\t1,5\tx\t120")
    found["pasted table"] = serious(page)
    assert found == {place: [] for place in found}
    button(page, "中文").click()
    expect(button(page, "撤销")).to_be_visible()
    english = page.evaluate(
        r"""[...document.querySelectorAll(".define button, .define h2, .define h3, .define label")]
            .map((each) => each.textContent).filter((text) => /^[A-Z][a-z]+ [a-z]+/.test(text))"""
    )
    assert english == []


def test_the_arm_and_its_frames_are_drawn(open_page):
    page = opened(open_page, "pt500")
    choose(page, 2)
    settled(page)
    expect(drawing(page)).to_have_attribute("data-shapes", "6")
    keep_picture(page, "define")
    picture = page.screenshot()
    if os.environ.get("ROBOMESH_PICTURES") == "1":
        PICTURE.write_bytes(picture)
        assert len(picture) < LARGEST_BYTES
    scene = cv2.imdecode(np.frombuffer(drawing(page).screenshot(), np.uint8), cv2.IMREAD_COLOR).astype(int)
    blue, green, red = scene.transpose(2, 0, 1)
    painted = ((blue > 90) & (blue - red > 60)).sum()
    normals = ((red > 180) & (green > 110) & (blue < 110)).sum()
    assert painted > 4000  # the Pt500 is blue
    assert normals > 100  # the common normals are orange
