"""The pages in a Firefox of the system, as Firefox ESR: skipped without one."""

import shutil

import pytest

from tests.browser.firefox import running_firefox
from tests.browser.rendering import rendering
from tests.site import wait_until

pytestmark = [pytest.mark.long, pytest.mark.browser]

PROGRAM = shutil.which("firefox-esr") or shutil.which("firefox") or ""
PAGES = {
    "": ".tile",
    "#/hall/pt600": ".joint-row",
    "#/program/hall/pt600": "main",
    "#/wall": "main",
    "#/recordings": "main",
    "#/define": "main",
    "#/events": "main",
    "#/settings": "main",
}
SCENE = "document.querySelector('.canvas-place canvas')"


@pytest.fixture(scope="module")
def firefox(plant, tmp_path_factory):
    if not PROGRAM:
        pytest.skip("no Firefox")
    with running_firefox(PROGRAM, tmp_path_factory.mktemp("firefox")) as running:
        running.resize(1440, 900)
        yield running
        assert running.errors == []


def button(text):
    return f"[...document.querySelectorAll('button')].find((each) => each.textContent.trim() === {text!r})"


@pytest.mark.parametrize("path", PAGES)
def test_every_page_loads(firefox, plant, path):
    firefox.open(f"{plant.address}/{path}")
    firefox.wait(f"!!document.querySelector('{PAGES[path]}')")
    assert firefox.errors == []


def test_a_moving_arm_is_drawn(firefox, plant):
    firefox.open(f"{plant.address}/#/hall/pt600")
    if not firefox.evaluate("!!document.createElement('canvas').getContext('webgl2')"):
        firefox.wait("document.querySelector('.scene-word.trouble')?.textContent")
        pytest.skip("this Firefox has no WebGL here, which the page says")
    firefox.wait(f"{SCENE}?.dataset.loaded === 'true'")
    before = firefox.wait(f"Number({SCENE}.dataset.drawn)")
    firefox.wait(f"{SCENE}.dataset.drawn > {before + 3}")


def test_the_video_of_an_arm_plays(firefox, plant, tmp_path):
    with rendering(plant, tmp_path, size=(320, 180)):
        firefox.open(f"{plant.address}/#/hall/pt600")
        # Video, or stills where this Firefox decodes none.
        firefox.wait("!!document.querySelector('.camera canvas[data-drawn=true], .camera img')", 120.0)


def test_a_robot_is_taken_and_moved(firefox, plant):
    firefox.open(f"{plant.address}/#/hall/arm")
    firefox.wait("!!document.querySelector('.joint-row')")
    firefox.click("document.querySelector('.control input[type=text]')")
    firefox.type("li")
    holder = "document.querySelector('.holder').textContent"

    def taken():
        firefox.click(button("Take control"))
        try:
            return firefox.wait(f"{holder} === 'You are in control'", 6.0)
        except AssertionError:
            return False

    wait_until(taken, 60.0)
    shown = "document.querySelector('[data-joint]').textContent"
    firefox.click(button("Home"))
    firefox.wait("document.querySelector('.facts').textContent.includes('· homed')")
    firefox.wait("document.querySelector('.headline .state').textContent === 'Idle'")
    before = firefox.evaluate(shown)

    def moved():
        firefox.click("document.querySelectorAll('.step')[1]")
        try:
            return firefox.wait(f"{shown} !== {before!r}", 6.0)
        except AssertionError:
            return False

    wait_until(moved, 60.0)
    firefox.click(button("Release"))
    firefox.wait(f"{holder} === 'Nobody is in control'")
