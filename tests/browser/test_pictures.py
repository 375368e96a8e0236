"""The pictures of the page in the README: the page itself, before a real site."""

import os
import re
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import expect

from robots.descriptions.cells import Fixture
from robots.schema.robot_toml import Pose
from services.site_file.tables.fixtures import Fixture as FixtureRow
from services.site_file.tables.fixtures import fixture_shape, fixture_to_site
from tests.browser.crowd import crowd
from tests.browser.rendering import rendering
from tests.browser.robot_page import (
    drawings,
    keep_picture,
    scene,
    take,
    tile,
    tiles,
    video_picture,
)
from tests.site import wait_until

pytestmark = pytest.mark.browser

DOCS = Path(__file__).resolve().parents[2] / "docs"
PICTURE = DOCS / "robot-page.png"
# Fixtures around an arm that its demonstration does not reach.
FIXTURES = tuple(
    Fixture(row.name, (fixture_shape(row),), fixture_to_site(row))
    for row in (
        FixtureRow(
            cell="",
            name="bench",
            box=(300.0, 500.0, 120.0),
            pose=Pose(xyz=(600.0, 0.0, 60.0)),
            color="#8a8f94",
        ),
        FixtureRow(
            cell="",
            name="post",
            cylinder=(25.0, 1000.0),
            pose=Pose(xyz=(-450.0, 450.0, 500.0)),
            color="#8a8f94",
        ),
    )
)
LARGEST_BYTES = 400_000
# A picture worth printing has a whole minute of curves in it.
CURVES_S = 62.0
WANTED = os.environ.get("ROBOMESH_PICTURES") == "1"


@pytest.fixture
def rendered(plant, tmp_path):
    """Yield the plant's moving arm, rendered."""
    smaller = {} if WANTED else {"size": (640, 360), "fps": 10, "anti_aliasing": 0}
    with rendering(plant, tmp_path, **smaller):
        yield


def orange(png):
    """Return the area of a picture with the arm's colour [px]."""
    blue, green, red = (
        cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR).astype(int).transpose(2, 0, 1)
    )
    return int(((red > 120) & (red - blue > 70) & (red > green)).sum())


def test_the_page_shows_the_arm_moving_in_3d_and_as_video(open_page, rendered):
    page = open_page("#/hall/pt600")
    expect(scene(page)).to_have_attribute("data-loaded", "true")
    expect(scene(page)).to_have_attribute("data-fixtures", "2")
    page.get_by_role("button", name="Trail").click()
    expect(video_picture(page)).to_have_attribute("data-drawn", "true")
    if WANTED:
        time.sleep(CURVES_S)
    take(page)
    keep_picture(page, "robot")
    # A move has just begun, so that it is still going on when the picture is taken; nothing is late.
    slow, fast = (
        "() => { const speed = Number.parseFloat(document.querySelectorAll('.tool .number')[6].textContent);"
        f" return speed {than} && !document.querySelector('.age, .scene-stale') }}"
        for than in ("< 5", "> 50")
    )
    page.wait_for_function(slow)
    page.wait_for_function(fast)
    if WANTED:
        page.screenshot(path=PICTURE)
        assert PICTURE.stat().st_size < LARGEST_BYTES
    for place, least in ((scene(page), 4000), (video_picture(page), 1000)):
        # A picture that is stale for a moment has no colour.
        wait_until(lambda place=place, least=least: orange(place.screenshot()) > least)


COLLIDING = """# Down to the bench, and too far
speed 60
point above = pose 420 0 500 180 0 0
move_joints above
move_line 420 0 350 180 0 0
wait 0.5
move_line 520 80 -20 180 0 0
move_joints 60 70 -80 0 0
"""


@pytest.mark.skipif(not WANTED, reason="makes the picture of the Program page, with ROBOMESH_PICTURES=1")
def test_the_program_page_shows_where_a_program_collides(open_page):
    page = open_page("#/program/hall/pt600")
    expect(page.get_by_role("textbox", name="Program text")).not_to_have_value(
        ""
    )  # the example is shown first
    page.get_by_role("textbox", name="Program text").fill(COLLIDING)
    row = page.get_by_role("button", name="touches bench").first
    row.click()
    time.sleep(4.0)
    page.screenshot(path=DOCS / "program-page.png")
    assert (DOCS / "program-page.png").stat().st_size < LARGEST_BYTES


@pytest.mark.skipif(not WANTED, reason="makes the picture of the Fleet page, with ROBOMESH_PICTURES=1")
def test_the_fleet_page_shows_two_sites_and_what_needs_a_look(open_page, plant, raised):
    raised("joints.gone", "no positions come from it")
    with crowd(plant.endpoint, ("yard",), 3) as yard:
        page = open_page(height=1024)
        for each in tiles(page).all():
            expect(drawings(each)).to_have_attribute("data-drawn", re.compile("."), timeout=120_000)
        expect(tile(page, "hall/arm").get_by_text("high", exact=True)).to_be_visible()
        yard.mark("faulty", ["yard/r001"])
        yard.mark("silent", ["yard/r002"])
        expect(tiles(page).filter(has_text="following error")).to_have_count(1)
        expect(tiles(page).filter(has_text="stale")).to_have_count(1)
        page.wait_for_timeout(2000)
        page.screenshot(path=DOCS / "fleet-page.png")
    assert (DOCS / "fleet-page.png").stat().st_size < 300_000
