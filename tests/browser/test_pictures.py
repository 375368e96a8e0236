"""The picture of the page in the README: the page itself, before a real site with a renderer."""

import asyncio
import os
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import expect

from renderer import service
from renderer.errors import NoEncoderError, NoOpenGLError

pytestmark = pytest.mark.browser

PICTURE = Path(__file__).resolve().parents[2] / "docs" / "robot-page.png"
LARGEST_BYTES = 400_000
# A picture worth printing has a whole minute of curves in it.
CURVES_S = 62.0
WANTED = os.environ.get("ROBOMESH_PICTURES") == "1"


@pytest.fixture
def rendered(plant, tmp_path):
    """The plant's moving arm, rendered."""

    async def start():
        settings = service.Settings(site="hall", robots=("pt600",), folder=tmp_path)
        task = plant.loop.create_task(service.serve(plant.session, settings))
        await asyncio.wait([task], timeout=1.0)
        if task.done():
            task.result()
        return task

    async def end(task):
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    try:
        task = plant.call(start())
    except (NoOpenGLError, NoEncoderError) as error:
        pytest.skip(f"nothing is rendered here: {error}")
    yield
    plant.call(end(task))


def orange(png):
    """How much of a picture has the arm's colour [px]."""
    blue, green, red = (
        cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR).astype(int).transpose(2, 0, 1)
    )
    return int(((red > 120) & (red - blue > 70) & (red > green)).sum())


def test_the_page_shows_the_arm_moving_in_3d_and_as_video(open_page, rendered):
    page = open_page("#/hall/pt600")
    page.wait_for_selector('canvas[data-loaded="true"]')
    page.get_by_role("button", name="Trail").click()
    expect(page.locator(".camera .picture-word")).to_have_count(0, timeout=30_000)
    page.get_by_label("Your name").fill("li")
    page.get_by_role("button", name="Take control").click()
    expect(page.locator(".holder")).to_have_text("You are in control")
    if WANTED:
        time.sleep(CURVES_S)
    # A move has just begun, so that it is still going on when the picture is taken; nothing is late.
    slow, fast = (
        "() => { const speed = Number.parseFloat(document.querySelectorAll('.tool dd')[6].textContent);"
        f" return speed {than} && !document.querySelector('.age, .scene-stale') }}"
        for than in ("< 5", "> 50")
    )
    page.wait_for_function(slow)
    page.wait_for_function(fast)
    if WANTED:
        page.screenshot(path=PICTURE)
        assert PICTURE.stat().st_size < LARGEST_BYTES
    assert orange(page.locator(".canvas-place").screenshot()) > 4000
    assert orange(page.locator(".camera .picture").screenshot()) > 1000
