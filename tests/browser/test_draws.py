"""The Robot page draws only what changed: a robot at rest still sends its joint states."""

import re
import time

import pytest
from playwright.sync_api import expect

from tests.browser.robot_page import (
    ARM,
    button,
    region,
    scene,
)

pytestmark = pytest.mark.browser

# So that the page's clock ticks, and joint states arrive, within each look at it.
LOOK_MS = 2000


def plot(page):
    return page.get_by_role("region", name="Plot 1").get_by_role("img")


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
    # A plot of 10 s is level after 10 s of rest.
    page = open_page(f"{ARM}?plot=10,joints")
    expect(scene(page)).to_have_attribute("data-loaded", "true")
    wait_at_rest(page, scene(page))
    wait_at_rest(page, plot(page))
    expect(region(page, "Joints").get_by_text(re.compile("^stale"))).to_have_count(
        0
    )  # the joint states are live
    expect_drawn_after(scene(page), lambda: scene(page).press("ArrowLeft"))
    wait_at_rest(page, scene(page))
    expect_drawn_after(scene(page), button(page, "Light").click)
    wait_at_rest(page, scene(page))
    expect_drawn_after(scene(page), lambda: page.set_viewport_size({"width": 1200, "height": 900}))
    wait_at_rest(page, scene(page))
    expect_drawn_after(scene(page), lambda: plant.call(plant.stop_controller("arm")))
    expect(region(page, "3-D view")).to_have_class(re.compile("is-stale"))


def test_a_moving_robot_is_drawn_all_the_time(open_page):
    page = open_page("#/hall/pt600")
    expect(scene(page)).to_have_attribute("data-loaded", "true")
    for place in (scene(page), plot(page)):
        for _ in range(3):
            expect_drawn_after(place, lambda: None)


@pytest.mark.long
def test_a_coarse_picture_is_drawn_in_full_once_nothing_moves(open_page):
    page = open_page(ARM)
    canvas = scene(page)
    expect(canvas).to_have_attribute("data-loaded", "true")
    # A busy page makes every frame slow.
    page.evaluate(
        "() => { window.busy = setInterval(() => {"
        "const end = performance.now() + 150; while (performance.now() < end); }, 160); }"
    )
    canvas.focus()
    for _ in range(100):
        if canvas.get_attribute("data-pixel-ratio") != "1":
            break
        page.keyboard.press("ArrowLeft")
        page.wait_for_timeout(50)
    else:
        raise AssertionError("the picture never became coarse")
    page.evaluate("() => clearInterval(window.busy)")
    expect(canvas).to_have_attribute("data-pixel-ratio", "1")
