"""The Robot page draws only what changed: a robot at rest still sends its joint states."""

import time

import pytest
from playwright.sync_api import expect

from tests.browser.robot_page import ARM, button

pytestmark = pytest.mark.browser

# So that the page's clock ticks, and joint states arrive, within each look at it.
LOOK_MS = 2000

SCENE, PLOT = ".canvas-place canvas", ".plot"


def drawn(page, place):
    return int(page.locator(place).get_attribute("data-drawn") or 0)


def wait_at_rest(page, place, timeout_s=60.0):
    """Wait until nothing is drawn during one look: a stall of a busy machine may turn the robot grey."""
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        before = drawn(page, place)
        page.wait_for_timeout(LOOK_MS)
        if before and drawn(page, place) == before:
            return
    raise AssertionError(f"{place} is drawn although nothing changes")


def expect_drawn_after(page, place, do):
    before = drawn(page, place)
    do()
    expect(page.locator(place)).not_to_have_attribute("data-drawn", str(before))


def test_a_robot_at_rest_is_not_drawn_again(open_page, plant):
    # A plot of 10 s is level after 10 s of rest.
    page = open_page(f"{ARM}?plot=10,joints")
    expect(page.locator(SCENE)).to_have_attribute("data-loaded", "true")
    wait_at_rest(page, SCENE)
    wait_at_rest(page, PLOT)
    expect(page.locator(".joints .age")).to_have_count(0)  # the joint states are live
    expect_drawn_after(page, SCENE, lambda: page.locator(SCENE).press("ArrowLeft"))
    wait_at_rest(page, SCENE)
    expect_drawn_after(page, SCENE, button(page, "Light").click)
    wait_at_rest(page, SCENE)
    expect_drawn_after(page, SCENE, lambda: page.set_viewport_size({"width": 1200, "height": 900}))
    wait_at_rest(page, SCENE)
    expect_drawn_after(page, SCENE, lambda: plant.call(plant.stop_controller("arm")))
    expect(page.locator(".scene.is-stale")).to_have_count(1)


def test_a_moving_robot_is_drawn_all_the_time(open_page):
    page = open_page("#/hall/pt600")
    expect(page.locator(SCENE)).to_have_attribute("data-loaded", "true")
    for place in (SCENE, PLOT):
        for _ in range(3):
            expect_drawn_after(page, place, lambda: None)


def test_a_coarse_picture_is_drawn_in_full_once_nothing_moves(open_page):
    page = open_page(ARM)
    canvas = page.locator('.scene canvas[data-loaded="true"]')
    expect(canvas).to_be_visible()
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
