"""The robot's page in a real Chromium on a real site: display, control, stop."""

import asyncio
import contextlib
import re
import time

import pytest
from playwright.sync_api import expect

from controllers.universal_robots.interfaces.modes import RobotMode
from controllers.universal_robots.settings import MotionSettings, UniversalRobotsSettings
from protocol_gateway import gateway
from protocol_gateway.configuration.settings import RobotSettings
from protocol_gateway.seam import Recovery
from robomesh.wire.session import SessionSettings, open_session
from services.kinematics import kinematics
from tests.browser.robot_page import (
    ARM,
    HOME,
    audited,
    button,
    control_notice,
    degrees,
    drag,
    events,
    joint_track,
    joint_value,
    joint_values,
    joints_notice,
    ready,
    region,
    reset_stop,
    scene,
    scene_stale,
    serious,
    state_word,
    stop_button,
    stop_notice,
    stop_panel,
    take,
    tiles,
    tool_values,
    wait_to_move,
    who_controls,
)
from tests.cells import single_arm
from tests.controllers.universal_robots import ur_site
from tests.site import wait_until

pytestmark = pytest.mark.browser


def test_a_moving_arm_is_drawn_as_it_moves(open_page):
    page = open_page("#/hall/pt600")
    expect(scene(page)).to_have_attribute("data-loaded", "true")
    before = degrees(page, "waist"), int(scene(page).get_attribute("data-drawn"))
    wait_until(lambda: int(scene(page).get_attribute("data-drawn")) > before[1] + 3)
    expect(joint_value(page, "waist")).not_to_have_text(f"{before[0]:.2f}°".replace("-", "−"))
    expect(scene_stale(page)).to_have_count(0)
    expect(tool_values(page).first).to_have_text(re.compile(r"\d+\.\d\s*mm"))


def test_without_control_nothing_on_the_page_can_move_the_arm(open_page, plant):
    page = open_page(ARM, drawn=False)
    expect(joint_track(page, "waist")).to_be_visible()
    assert page.get_by_role("slider", name="Target of").count() == 0
    for name in ("Home", "Hold"):
        expect(button(page, name)).to_be_disabled()
    step = re.compile(r"[+−]\d")
    expect(page.get_by_role("button", name=step)).to_have_count(10)
    expect(page.get_by_role("button", name=step, disabled=False)).to_have_count(0)
    box = joint_track(page, "waist").bounding_box()
    page.mouse.click(box["x"] + 10, box["y"] + box["height"] / 2)
    assert audited(plant, "MOVE_ABSOLUTE") == 0


def test_a_slider_moves_the_joint_when_it_is_let_go_and_not_before(open_page, plant):
    page = open_page(ARM)
    ready(page)
    moves, start = audited(plant, "MOVE_ABSOLUTE"), degrees(page, "waist")
    drag(page, "waist", 30, release=False)
    expect(joints_notice(page)).to_contain_text("Target waist:")
    assert audited(plant, "MOVE_ABSOLUTE") == moves
    # Every link beyond the waist is shown where it would be.
    expect(scene(page)).to_have_attribute("data-ghost", "5")
    wanted = float(re.search(r"waist: (\S+)°", joints_notice(page).inner_text())[1].replace("−", "-"))
    assert wanted > start + 5
    page.mouse.up()
    expect(joint_value(page, "waist")).to_have_text(f"{wanted:.2f}°".replace("-", "−"))
    assert audited(plant, "MOVE_ABSOLUTE") > moves
    # A tap next to the handle sets no target.
    moves = audited(plant, "MOVE_ABSOLUTE")
    box = joint_track(page, "waist").bounding_box()
    page.mouse.click(box["x"] + 4, box["y"] + box["height"] / 2)
    expect(joints_notice(page)).not_to_contain_text("Target waist")
    assert audited(plant, "MOVE_ABSOLUTE") == moves


@pytest.mark.long
def test_a_target_that_homing_left_behind_moves_no_joint_that_nobody_touched(open_page, plant):
    page = open_page(ARM, drawn=False)
    ready(page)
    wait_to_move(page, "waist", lambda: drag(page, "waist", 60))
    button(page, "Home").click()
    expect(joint_values(page)).to_have_text(HOME)
    expect(state_word(page)).to_have_text("Idle")
    home = degrees(page, "waist")
    wait_to_move(page, "wrist", lambda: drag(page, "wrist", 20))
    expect(state_word(page)).to_have_text("Idle")
    assert degrees(page, "waist") == pytest.approx(home, abs=0.02)


def test_space_asks_for_a_stop_and_only_its_reset_lets_motion_go_on(open_page):
    page = open_page(ARM, drawn=False)
    ready(page)
    drag(page, "waist", -60)
    page.keyboard.press("Space")
    expect(stop_notice(page)).to_contain_text("Stop sent to hall/arm")
    expect(state_word(page)).to_have_text("Stopped")
    expect(button(page, "Home")).to_be_disabled()
    reset_stop(page)
    expect(button(page, "Home")).to_be_enabled()


def test_stop_works_without_control_and_names_who_asked(open_page):
    page = open_page(ARM, drawn=False)
    page.get_by_label("Your name").fill("wang")
    stop_button(page).click()
    expect(stop_panel(page)).to_contain_text("Stopped by wang")
    expect(stop_panel(page).get_by_role("paragraph")).to_have_text("No motion until it is reset.")
    expect(page.get_by_role("button", name="Reset stop")).to_be_disabled()


@pytest.mark.long
def test_the_choice_of_a_program_says_where_it_is_and_its_stop_names_the_whole_fleet(open_page):
    page = open_page("#/program", drawn=False)
    crumbs = page.get_by_role("navigation", name="Robot of this page")
    expect(crumbs).to_contain_text("Go to a robot")
    expect(crumbs.get_by_role("strong")).to_have_text("Program")
    expect(stop_button(page)).to_have_attribute("title", re.compile("^Asks all robots of the fleet"))


def test_a_hidden_page_gives_control_back(open_page):
    page = open_page(ARM, drawn=False)
    take(page)
    page.evaluate(
        "Object.defineProperty(document, 'hidden', {value: true, configurable: true});"
        "document.dispatchEvent(new Event('visibilitychange'))"
    )
    expect(control_notice(page)).to_contain_text("this page was hidden")
    expect(who_controls(page)).to_have_text("Nobody is in control")
    expect(events(page).filter(has_text="li's page was hidden or closed")).not_to_have_count(0)


def test_going_to_another_page_gives_control_back(open_page):
    page, other = open_page(ARM, drawn=False), open_page(ARM, drawn=False)
    take(page)
    expect(who_controls(other)).to_have_text("li is in control")
    given_back = events(other).filter(has_text="li released control")
    before = given_back.count()
    page.get_by_role("link", name="Fleet", exact=True).click()
    expect(who_controls(other)).to_have_text("Nobody is in control")
    expect(given_back).to_have_count(before + 1)  # and not: its time was over


def test_when_the_controller_falls_silent_nothing_looks_live(open_page, plant):
    page = open_page("#/hall/pt600")
    expect(scene(page)).to_have_attribute("data-loaded", "true")
    expect(scene_stale(page)).to_have_count(0)
    port = plant.call(plant.stop_controller("pt600"))
    try:
        expect(scene_stale(page)).to_contain_text(re.compile(r"stale \d"))
        expect(joint_value(page, "waist")).to_have_class(re.compile("stale"))
        expect(state_word(page)).to_have_text("No link")
        expect(stop_button(page)).to_have_text("Stop cannot arrive: use the emergency stop")
        late = open_page("#/hall/pt600", drawn=False)  # a page that is opened now shows old values as old too
        expect(joint_value(late, "waist")).to_have_class(re.compile("stale"))
        expect(scene_stale(late)).to_be_visible()
    finally:
        plant.call(plant.start_controller("pt600", port, demo=True))
    expect(scene_stale(page)).to_have_count(0)


def test_the_fleet_shows_every_robot_with_its_state_and_leads_to_it(open_page):
    page = open_page(drawn=False)
    expect(tiles(page)).to_have_count(2)
    expect(tiles(page).nth(1)).to_contain_text("pt600")
    expect(tiles(page).nth(1)).to_contain_text("Nobody is in control")
    expect(tiles(page).nth(1)).to_contain_text("gateway")
    page.get_by_placeholder("Filter robots").fill("pt6")
    expect(tiles(page)).to_have_count(1)
    tiles(page).click()
    expect(page.get_by_role("heading", level=1)).to_have_text("pt600")


def test_a_phone_shows_one_column_with_stop_under_the_thumb(open_page):
    page = open_page(width=360, height=740, has_touch=True, drawn=False)
    for path, there in (("#/", tiles(page).first), ("#/hall/pt600", joint_value(page, "waist"))):
        page.evaluate("path => (location.hash = path)", path)
        expect(there).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth") == 360
        stop = stop_button(page).bounding_box()
        assert stop["height"] >= 44
        assert stop["y"] + stop["height"] <= 740
        small = page.evaluate(
            "[...document.querySelectorAll('button, input, a.tile')]"
            ".filter(e => e.offsetParent && e.getBoundingClientRect().height < 44)"
            ".map(e => e.outerHTML.slice(0, 80))"
        )
        assert small == []


@pytest.mark.long
def test_a_control_room_sees_everything_of_a_robot_without_scrolling(open_page):
    page = open_page("#/hall/pt600", drawn=False)
    expect(joint_value(page, "waist")).to_be_visible()
    assert page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]") == [
        1440,
        900,
    ]
    for name in ("3-D view", "Control", "Joints", "Tool", "Events", "Video", "Plots"):
        box = region(page, name).bounding_box()
        assert box["y"] + box["height"] <= 900, name
        assert box["height"] >= 80, name


@pytest.mark.long
def test_the_video_can_have_the_large_place_and_stop_stays_where_it_is(open_page):
    page = open_page(ARM, drawn=False)
    stop = stop_button(page).bounding_box()
    place = page.get_by_label("Where the video stands")
    place.select_option("large")
    sizes = [region(page, name).bounding_box()["height"] for name in ("Video", "3-D view")]
    assert sizes[0] > 1.5 * sizes[1]
    assert stop_button(page).bounding_box() == stop
    place.select_option("inset")
    inset, large = (region(page, name).bounding_box() for name in ("Video", "3-D view"))
    assert inset["y"] > large["y"]
    assert inset["x"] + inset["width"] < large["x"] + large["width"]
    place.select_option("beside")
    assert region(page, "3-D view").bounding_box()["height"] == pytest.approx(sizes[0], abs=2)


@contextlib.asynccontextmanager
async def robot_of_ur(plant, folder, monkeypatch):
    """Run another robot of the site, whose controller may be recovered; yield its simulated controller."""
    mesh = SessionSettings(connect=(plant.endpoint,))
    async with (
        ur_site.controller(monkeypatch) as (ports, server),
        open_session(mesh) as for_gateway,
        open_session(mesh) as for_kinematics,
    ):
        for_gateway.declare_presence("hall", "ur", "gateway")
        for_kinematics.declare_presence("hall", "ur", "kinematics")
        robot = RobotSettings(
            name="ur",
            description="puma560",
            host="127.0.0.1",
            port=ports.rtde,
            ports=ur_site.others(ports),
            protocol="rtde",
            options=UniversalRobotsSettings(motion=MotionSettings()),
            simulated=True,
            stop_proven=True,
            recover=frozenset({Recovery.POWER_ON, Recovery.BRAKE_RELEASE}),
        )
        cell = kinematics.Settings(site="hall", robots=(single_arm("ur", "puma560", simulated=True),))
        site = gateway.Settings(site="hall", robots=(robot,), audit_folder=folder)
        serving = [
            plant.loop.create_task(gateway.serve(for_gateway, site)),
            plant.loop.create_task(kinematics.serve(for_kinematics, cell)),
        ]
        try:
            yield server
        finally:
            for each in serving:
                each.cancel()
            await asyncio.gather(*serving, return_exceptions=True)


def test_a_controller_is_recovered_only_with_a_choice_a_look_and_a_reason(
    open_page, plant, tmp_path, monkeypatch
):
    running = robot_of_ur(plant, tmp_path, monkeypatch)
    server = plant.call(running.__aenter__())
    try:
        server.controller.power_off(time.monotonic())
        page = open_page("#/hall/ur", drawn=False)
        expect(button(page, "Recover…")).to_be_disabled()
        take(page)
        button(page, "Recover…").click()
        form = page.get_by_role("form", name="Recover the controller")
        send = form.get_by_role("button", name="Send to the controller")
        # Nothing is chosen before, and what the site file does not allow is not there.
        expect(form.get_by_role("radio", checked=True)).to_have_count(0)
        expect(form.get_by_role("radio")).to_have_count(3)
        form.get_by_label("Power on").check()
        expect(send).to_be_disabled()
        form.get_by_label("A person at the robot has looked").check()
        expect(send).to_be_disabled()
        form.get_by_role("textbox").fill("the breaker was off; it is on again")
        assert server.controller.robot_mode == RobotMode.POWER_OFF
        send.click()
        expect(form).to_have_count(0)
        wait_until(lambda: server.controller.robot_mode != RobotMode.POWER_OFF)
        expect(events(page).filter(has_text="the breaker was off").first).to_be_visible()
        # Last, because the check may block the page for longer than control lasts.
        button(page, "Recover…").click()
        expect(form).to_be_visible()
        assert serious(page, "form.reason") == []
    finally:
        plant.call(running.__aexit__(None, None, None))
