"""A robot's page in a cell: surroundings, checks and runs, against a real site."""

import asyncio
import re
import time
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import pytest
from playwright.sync_api import expect

from robomesh.wire.session import open_session
from tests.browser.robot_page import (
    keep_picture,
    region,
    scene,
    serious,
    stop_panel,
    who_controls,
)
from tests.conftest import last_value
from tests.site import READY_S, running_site
from web import build_page

pytestmark = pytest.mark.browser

PAGE = "#/test/arm"
# The other arm is out of reach.
SITE = """
[[robot]]
name = "arm"
model = "pt600"
cell = "a"
check = "require"

[[robot]]
name = "mate"
model = "pt600"
cell = "a"
check = "off"
pose = { xyz = [1500.0, 0.0, 0.0] }

[[fixture]]
cell = "a"
name = "post"
cylinder = [40.0, 900.0]
pose = { xyz = [300.0, 250.0, 450.0] }
"""
PROGRAM = """speed 5
move_joints 0 80 -80 0 0
move_joints 0 90 -90 0 0
"""
SLOWLY_MS = 40_000


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    build_page.build()
    with running_site(tmp_path_factory.mktemp("cell"), robots=SITE, services=()) as site:
        deadline = time.monotonic() + READY_S
        while "still starting" in (homed := site.command("send", "arm", "home")).stdout:
            assert time.monotonic() < deadline, homed.stdout
        assert homed.returncode == 0, homed.stdout
        yield SimpleNamespace(address=site.console.rstrip("/"), site=site)


def newest(plant, topic):
    """Return the newest message of the mesh about the arm."""

    async def heard():
        async with open_session(plant.site.mesh) as session:
            return await last_value(session, f"robomesh/test/arm/{topic}")

    # Playwright's own loop runs in this thread.
    with ThreadPoolExecutor() as threads:
        return threads.submit(lambda: asyncio.run(heard())).result(20)


def test_what_stands_around_an_arm_is_in_its_picture_with_the_line_to_what_is_nearest(open_page):
    page = open_page(PAGE)
    for name, value in (("loaded", "true"), ("fixtures", "1"), ("neighbours", "1")):
        expect(scene(page)).to_have_attribute(f"data-{name}", value)
    length = region(page, "3-D view").get_by_text(re.compile(r"^\d+\.\d\smm$"))
    expect(length).to_be_visible(timeout=SLOWLY_MS)
    expect(page.get_by_text("motions are checked: required")).to_be_visible()
    assert serious(page) == []


def test_a_fixture_is_moved_with_numbers_after_a_confirmation_and_moved_back(open_page, plant):
    page = open_page("#/cell/test/arm", drawn=False)
    file = plant.site.folder / "site.toml"
    before = file.read_text()
    page.get_by_role("button", name="post").click()
    place = page.get_by_role("group", name="Position in the site's frame")
    place.get_by_label("x").fill("320")
    page.get_by_role("button", name="Review change…").click()
    form = page.get_by_role("form", name="Change this cell?")
    expect(form).to_contain_text("post: xyz [300, 250, 450] → [320, 250, 450]", timeout=SLOWLY_MS)
    assert file.read_text() == before
    assert serious(page) == []
    keep_picture(page, "cell")
    form.get_by_role("button", name="Change cell").click()
    said = page.get_by_role("region", name="Fixtures and floor").get_by_role("status")
    expect(said).to_contain_text("Changed: post", timeout=SLOWLY_MS)
    assert file.read_text() == before.replace("[300.0, 250.0, 450.0]", "[320.0, 250.0, 450.0]")
    assert newest(plant, "description").fixtures[0].fixture_to_site[3] == pytest.approx(0.32)
    page.get_by_role("button", name="Undo last change…").click()
    form.get_by_role("button", name="Change cell").click(timeout=SLOWLY_MS)
    expect(said).to_contain_text("→ [300, 250, 450]", timeout=SLOWLY_MS)
    expect(page.get_by_role("button", name="post")).to_contain_text("300, 250, 450 mm")
    expect(place.get_by_label("x")).to_have_value("300", timeout=SLOWLY_MS)
    assert file.read_text() == before
    expect(page.get_by_text("They change with a restart of the site's services.")).to_be_visible()


def test_every_monitor_sees_the_line_of_the_program_that_runs_and_that_it_is_done(open_page, plant, tmp_path):
    page = open_page(PAGE, drawn=False, width=360, height=740)
    expect(page.get_by_text("motions are checked: required")).to_be_visible(timeout=SLOWLY_MS)
    (tmp_path / "to-and-fro.robo").write_text(PROGRAM, encoding="utf-8")
    with ThreadPoolExecutor() as threads:
        file = str(tmp_path / "to-and-fro.robo")
        sent = threads.submit(plant.site.command, "send", "arm", "run", file)
        line = page.get_by_role("paragraph").filter(has_text=re.compile("^to-and-fro: "))
        running = r"to-and-fro: step \d of 3, line 2: move_joints 0 80 -80 0 0; \w+; 00:\d\d, 00:\d\d left"
        expect(line).to_have_text(re.compile(running), timeout=SLOWLY_MS)
        assert page.evaluate("document.documentElement.scrollWidth") == 360
        expect(line).to_have_text(re.compile("to-and-fro: done"), timeout=SLOWLY_MS)
    # Its sender gave control back when the arm rested, and stopped nothing.
    assert sent.result().returncode == 0
    expect(who_controls(page)).to_have_text("Nobody is in control")
    expect(stop_panel(page)).to_have_count(0)
