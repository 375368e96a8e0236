"""The Robot page draws only what changed: a robot at rest still sends its joint states."""

import re
import time

import pytest
from playwright.sync_api import expect

from tests.browser.robot_page import (
    ARM,
    region,
    scene,
)

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)

# So that the page's clock ticks, and joint states arrive, within each look at it.
LOOK_MS = 2000


def drawn(place):
    return int(place.get_attribute("data-drawn") or 0)


def wait_at_rest(page, place, timeout_s=60.0):
    """Wait until nothing is drawn during one look: a stall of a busy machine may turn the robot grey."""
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        before = drawn(place)
        page.wait_for_timeout(LOOK_MS)
        if before and drawn(place) == before:
            return
    raise AssertionError(f"{place} is drawn although nothing changes")


def expect_drawn_after(place, do):
    before = drawn(place)
    do()
    expect(place).not_to_have_attribute("data-drawn", str(before))


@pytest.mark.long
def test_a_robot_at_rest_is_not_drawn_again(open_page, plant):
    page = open_page(ARM)
    expect(scene(page)).to_have_attribute("data-loaded", "true")
    wait_at_rest(page, scene(page))
    expect(region(page, "Joints").get_by_text(re.compile("^stale"))).to_have_count(
        0
    )  # the joint states are live
    expect_drawn_after(scene(page), lambda: scene(page).press("ArrowLeft"))
    wait_at_rest(page, scene(page))
    expect_drawn_after(scene(page), lambda: plant.call(plant.stop_controller("arm")))
    expect(region(page, "3-D view")).to_have_class(re.compile("is-stale"))
