"""A robot's surroundings on its page, and a change of them, against a real site."""

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
