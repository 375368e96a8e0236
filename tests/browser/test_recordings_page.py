"""Recordings on the page: listed and played."""

import asyncio
import re

import pytest
from playwright.sync_api import expect

from robomesh.contract.keys import WHOLE_SITE
from robomesh.schemas import robomesh_pb2 as schema
from services import player
from services.recorder import recorder
from tests.browser.robot_page import (
    button,
    events,
    keep_picture,
    region,
    scene,
    serious,
    stop_button,
    until,
)

pytestmark = pytest.mark.browser

ROBOT = "robomesh/hall/pt600"
NAME = "swing"
LONG_S = 3.0  # of motion
_Ask = schema.RecorderRequest


@pytest.fixture(scope="module")
def recorded(plant, tmp_path_factory):
    """Yield a recorder and a player of the plant, and the file of a recording of its moving arm."""
    folder = tmp_path_factory.mktemp("recordings")

    async def start():
        own = plant.session
        for name in ("recorder", "player"):
            own.declare_presence("hall", WHOLE_SITE, name)
        serving = (
            recorder.serve(
                own,
                recorder.Settings(site="hall", robots=("pt600",), folder=folder, views=()),
            ),
            player.serve(own, player.Settings(site="hall", folder=folder)),
        )
        tasks = [plant.loop.create_task(each) for each in serving]
        await ask_recorder(plant, _Ask.TRACE_ON, name=NAME)
        acquire = schema.LeaseRequest(action=schema.LeaseRequest.ACQUIRE, ttl_s=0.5)
        await own.ask(f"{ROBOT}/lease/request/li", acquire, timeout_s=40.0)
        async with asyncio.timeout(40):
            async for sample in own.subscribe(f"{ROBOT}/recording"):
                recording = sample.message()
                if joints_in(recording) and recording.duration.ToTimedelta().total_seconds() >= LONG_S:
                    break
        closed = await ask_recorder(plant, _Ask.TRACE_OFF)
        path = next(folder.rglob(closed.file))
        path.with_name("empty.mcap").touch()
        return tasks, closed.file

    async def end(tasks):
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    tasks, file = plant.call(start())
    yield file
    plant.call(end(tasks))


async def ask_recorder(plant, action, **values):
    return await plant.session.ask(f"{ROBOT}/recorder/request", _Ask(action=action, **values), timeout_s=40.0)


def joints_in(recording):
    return sum(each.messages for each in recording.topics if each.topic.endswith("/joints"))


def play(page):
    """Open the recording from the list, and pause it."""
    page.get_by_role("link", name=f"Play {NAME}").click()
    expect(scene(page)).to_have_attribute("data-loaded", "true")
    expect(player_of(page)).to_have_attribute("data-replay", re.compile("^replay-"))


def player_of(page):
    """Return the player, which names its replay in `data-replay`."""
    return page.get_by_role("group", name="Player", exact=True)


def transport(page):
    return region(page, "Transport")


def play_button(page):
    return transport(page).get_by_role("button", name=re.compile("^(Play|Pause)$"))


def recordings(page):
    return page.get_by_role("list", name="Recordings", exact=True).get_by_role("listitem")


def curves(page):
    """Return the first chart; the line at the moment and the place of the curves have no role."""
    return page.get_by_role("figure").first


def curves_area(page):
    return curves(page).locator(".u-over")


def position(page):
    minutes, seconds = (
        transport(page).get_by_text(re.compile(r"^[\d:.]+ / ")).inner_text().split(" /")[0].split(":")
    )
    return 60 * int(minutes) + float(seconds)


def arm(page):
    return scene(page).screenshot()


def moment_line(page):
    return curves(page).locator(".moment-line").evaluate("line => line.getBoundingClientRect().left")


def test_a_recording_is_listed_and_played_and_a_seek_moves_arm_curves_and_clock(open_page, recorded):
    page = open_page("#/recordings", width=1280, height=800)
    card = recordings(page).filter(has=page.get_by_title(recorded, exact=True))
    expect(card).to_contain_text("pt600")
    expect(card).to_contain_text("messages")
    empty = recordings(page).filter(has=page.get_by_title("empty.mcap", exact=True))
    expect(empty.get_by_text("empty.mcap is empty: the disk was full")).to_be_visible()
    expect(empty.get_by_role("link", name="Play")).to_have_count(0)
    play(page)
    expect(page.get_by_text("replay of pt600").first).to_be_visible()
    expect(events(page).filter(has_text="li asked acquire").first).to_be_visible()
    expect(page.get_by_role("group", name="Events").get_by_role("button").first).to_be_visible()

    # It plays to its end without input.
    expect(button(transport(page), "Play")).to_be_visible()
    page.keyboard.press("Home")
    until(page, lambda: position(page) < 0.5)
    expect(curves(page)).to_be_visible()
    left, at_start = moment_line(page), arm(page)
    page.get_by_label("Moment").fill("1.5")
    until(page, lambda: abs(position(page) - 1.5) < 0.02)
    until(page, lambda: moment_line(page) > left + 10 and arm(page) != at_start)

    # A click into the curves goes there.
    box = curves_area(page).bounding_box()
    page.mouse.click(box["x"] + 0.2 * box["width"], box["y"] + box["height"] / 2)
    until(page, lambda: position(page) < 1.4)

    # The picture follows the joints, slowly enough for a busy machine.
    transport(page).get_by_label("Speed").select_option("0.1")
    begun, before = position(page), arm(page)
    page.keyboard.press("Space")
    until(page, lambda: position(page) > begun + 0.1 and arm(page) != before)
    button(page, "Pause").click()
    expect(button(transport(page), "Play")).to_be_visible()


@pytest.mark.long
def test_the_list_and_the_player_fit_a_phone_and_axe_finds_nothing_serious(open_page, recorded):
    page = open_page("#/recordings", width=360, height=740, drawn=False)
    expect(recordings(page).first).to_be_visible()
    fits = "document.documentElement.scrollWidth <= innerWidth"
    assert page.evaluate(fits)
    assert serious(page) == []
    keep_picture(page, "recordings")
    page.get_by_role("link", name=f"Play {NAME}").click()
    expect(play_button(page)).to_be_in_viewport()
    expect(stop_button(page)).to_be_in_viewport()
    assert page.evaluate(fits)
    assert play_button(page).bounding_box()["height"] >= 44
    expect(curves(page)).to_be_visible()
    assert serious(page) == []
    keep_picture(page, "player")
