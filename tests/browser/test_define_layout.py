"""How Define looks: on a phone, on a desk, in both languages, to a screen reader, in the README."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import expect

from services.console import build_page
from tests.browser.defining_page import button, choose, define_site, opened, settled, tab

pytestmark = pytest.mark.browser

PICTURE = Path(__file__).resolve().parents[2] / "docs" / "define-page.png"
LARGEST_BYTES = 400_000


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    with define_site(tmp_path_factory) as site:
        yield site


@pytest.mark.parametrize("path", ["#/define", "#/define/puma560"])
def test_a_phone_shows_one_column_that_scrolls_one_way(open_page, path):
    page = open_page(path, width=360, height=740)
    expect(page.locator(".robot-card" if path == "#/define" else ".dh-table").first).to_be_attached()
    for name in ("Details", "Robot", "Frames", "Constraints", "Collisions", "Views"):
        if path != "#/define":
            tab(page, name)
        assert page.evaluate("document.documentElement.scrollWidth") == 360
    small = page.evaluate(
        """[...document.querySelectorAll("main button, main a, main input:not([type=file]), main select")]
           .map((each) => [each.outerHTML.slice(0, 80), each.getBoundingClientRect().height])
           .filter(([, height]) => height > 0 && height < 44)"""
    )
    assert small == []


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (1024, 768)])
def test_on_a_desk_only_lists_scroll(open_page, width, height):
    page = opened(open_page, "puma560", width=width, height=height)
    settled(page)
    size = page.evaluate(
        """[document.documentElement.scrollWidth, document.documentElement.scrollHeight,
            document.body.scrollHeight]"""
    )
    assert size == [width, height, height]


@pytest.mark.parametrize("scheme", ["dark", "light"])
@pytest.mark.parametrize("path", ["#/define", "#/define/pt500"])
def test_axe_finds_nothing_serious_in_define(open_page, path, scheme):
    page = open_page(path)
    if scheme == "light":
        button(page, "Light").click()
    expect(page.locator(".robot-card" if path == "#/define" else ".dh-table").first).to_be_attached()
    page.evaluate((build_page.MODULES / "axe-core" / "axe.min.js").read_text())
    serious = []
    for name in ("Details",) if path == "#/define" else ("Robot", "Frames", "Collisions", "Views", "Details"):
        if path != "#/define":
            tab(page, name)
            if name == "Details":
                choose(page, 1)
        found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
        serious += [
            (name, each["id"], node["html"][:120], node["failureSummary"])
            for each in found["violations"]
            if each["impact"] in ("serious", "critical")
            for node in each["nodes"]
        ]
    assert serious == []


def test_define_speaks_chinese(open_page):
    page = opened(open_page, "pt500")
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
    expect(page.locator('.define-scene canvas[data-shapes="6"]')).to_have_count(1, timeout=30_000)
    picture = page.screenshot()
    if os.environ.get("ROBOMESH_PICTURES") == "1":
        PICTURE.write_bytes(picture)
        assert len(picture) < LARGEST_BYTES
    scene = cv2.imdecode(
        np.frombuffer(page.locator(".define-scene canvas").screenshot(), np.uint8), cv2.IMREAD_COLOR
    ).astype(int)
    blue, green, red = scene.transpose(2, 0, 1)
    painted = ((blue > 90) & (blue - red > 60)).sum()
    normals = ((red > 180) & (green > 110) & (blue < 110)).sum()
    assert painted > 4000  # the Pt500 is blue
    assert normals > 100  # the common normals are orange
