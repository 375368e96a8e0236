"""Actions and checks on a robot's page, for several test modules."""

import re
import time
from contextlib import contextmanager, suppress
from pathlib import Path

from playwright.sync_api import Error, expect

from robomesh.schemas.robomesh_pb2 import FaultRequest
from web import build_page

ARM = "#/hall/arm"
# A picture of every page at each of these widths, for a person to look through.
PICTURES = Path(__file__).resolve().parents[2] / ".pictures"
PICTURE_SIZES = ((1440, 900), (360, 740))
# A position with its unit; a dash if it is not known.
POSITION = re.compile(r"^\s*(−?\d+\.\d+|–)\s*(°|mm)\s*$")
TOOL_VALUE = re.compile(r"^\s*(−?\d+\.\d+|–)\s*(mm|°|mm/s)?\s*$")
# What each page shows once it is there, by role and name, in English and Chinese.
PAGES = {
    "#/": ("link", "^arm"),
    "#/hall/arm": ("group", "^(waist|腰部)$"),
    "#/hall/pt600": ("group", "^(waist|腰部)$"),
    "#/wall": ("article", ""),
    "#/recordings": ("heading", "^(Recordings|录制)"),
    "#/program": ("heading", "robot|机器人"),
    "#/program/hall/arm": ("textbox", "^(Program text|程序文本)$"),
    "#/define": ("heading", "^(New robot|新建机器人)$"),
    "#/events": ("region", "^(Alarms|报警)$"),
    "#/settings": ("region", "^(Sites and services|站点与服务)$"),
    "#/hall/nowhere": ("heading", "nowhere"),
}
HOME = ["0.00°", "90.00°", "−90.00°", "0.00°", "0.00°"]


def until(page, condition, *, seconds=40):
    """Wait for a condition that no locator can see, while the page goes on."""
    for _ in range(10 * seconds):
        if condition():
            return
        page.wait_for_timeout(100)
    raise AssertionError("it did not come about in time")


def button(page, name):
    return page.get_by_role("button", name=name, exact=True)


def region(page, name):
    return page.get_by_role("region", name=name, exact=True)


def who_controls(page):
    """Return who is in control, in words."""
    return page.get_by_role("status", name="Who is in control", exact=True)


def state_word(page):
    """Return the robot's state, in a word."""
    return page.get_by_role("status", name="State", exact=True)


def control_notice(page):
    """Return the outcome of the last command, or what to do first."""
    return region(page, "Control").get_by_label("Outcome", exact=True)


def joints_notice(page):
    """Return the outcome of the last motion of a joint, or what to do first."""
    return region(page, "Joints").get_by_label("Outcome", exact=True)


def joint_value(page, joint):
    """Return where a joint is, with its unit."""
    return page.get_by_role("group", name=joint, exact=True).get_by_text(POSITION)


def joint_values(page):
    """Return where each joint is, with its unit."""
    return region(page, "Joints").get_by_text(POSITION)


def tool_values(page):
    """Return the tool's pose, speed and manipulability, with their units."""
    return region(page, "Tool").get_by_role("definition").get_by_text(TOOL_VALUE)


def control_requests(page):
    """Return the requests and offers of control that are open."""
    return page.get_by_role("group", name="Request for control", exact=True)


def events(page):
    return page.get_by_role("list", name="Events", exact=True).get_by_role("listitem")


def requests(page):
    return page.get_by_role("list", name="Requests", exact=True).get_by_role("listitem")


def stop_notice(page):
    """Return what became of the last stop request."""
    return page.get_by_role("banner").get_by_label("Outcome", exact=True)


def alarm_band(page):
    """Return the alarm above the robot's page."""
    return page.get_by_role("alert").filter(has_text=re.compile("told to stop|^At "))


def scene_stale(page):
    """Return why the 3-D picture is not live; it is there only while it is not."""
    words = re.compile("stale|no data yet|No joints were recorded")
    return region(page, "3-D view").get_by_role("status").filter(has_text=words)


def video_panel(page):
    return page.get_by_role("region", name=re.compile("^(Video|视频)$"))


def video_picture(page):
    return video_panel(page).get_by_role("img")


def video_age(page):
    """Return how old the video is; it is there only while it is stale."""
    return video_panel(page).get_by_text(re.compile("^stale"))


def joint_track(page, joint):
    """Return the bar of a joint's range, which has no role of its own."""
    return page.get_by_role("group", name=joint, exact=True).locator(".track")


def drawings(tiles):
    """Return the canvas of each tile, which is hidden from screen readers."""
    return tiles.locator("canvas")


def alarms(page):
    """Return the alarms of the list, in English or Chinese."""
    return page.get_by_role("list", name=re.compile("^(Alarms|报警)$")).get_by_role("listitem")


def visit(page, path):
    """Go to a page, and wait until it is shown."""
    page.evaluate("path => (location.hash = path)", path)
    role, name = PAGES[path]
    expect(page.get_by_role("main").get_by_role(role, name=re.compile(name)).first).to_be_visible()


def scene(page):
    """Return the 3-D picture, which says in `data-loaded` whether its models are there."""
    return page.get_by_role("img", name=re.compile(r"^3-D view\."))


def tiles(page):
    """Return the robots of the fleet."""
    return page.get_by_role("region", name=re.compile("^Site ")).get_by_role("listitem").get_by_role("link")


def tile(page, robot):
    """Return a robot of the fleet: its name, or its site and name."""
    site, _, name = robot.rpartition("/")
    sites = page.get_by_role("region", name=re.compile(f"^Site {site}"))
    return sites.get_by_role("link", name=re.compile(rf"^{re.escape(name)}\b"))


def stop_button(page):
    return page.get_by_role(
        "button", name=re.compile("^(Stop request|Stop cannot|No stop from here|停止请求)")
    )


def stop_panel(page):
    """Return why the robot is stopped; it is there only while it is."""
    return page.get_by_role("group", name="Stopped", exact=True)


def answer(page, name):
    """Press a button of a request for control, which ignores presses while it is new."""
    pressed = button(page, name)
    expect(pressed).to_be_visible()
    page.wait_for_timeout(800)
    pressed.click()


def stand_still(page, seconds):
    """Block the page's scripts for so long, as in a browser that is too slow."""

    def close_later(dialog):
        time.sleep(seconds)
        dialog.accept()

    page.once("dialog", close_later)
    page.evaluate("alert()")


def answers_of(page):
    """Return a function that switches off, and on, what the page receives of the console, from the next load.

    It acts within the page: messages that pass through this process would wait for whatever it does.
    """
    page.add_init_script("""
        const { get, set } = Object.getOwnPropertyDescriptor(WebSocket.prototype, "onmessage");
        window.answersCome = true;
        Object.defineProperty(WebSocket.prototype, "onmessage", {
            get,
            set(handle) {
                set.call(this, handle && ((event) => window.answersCome && handle(event)));
            },
        });
    """)
    return lambda come: page.evaluate("come => (window.answersCome = come)", come)


def take(page, name="li", slow=True):
    """Take control; `slow`: as a browser that was seen to be slow, which gets leases of 4 s.

    A busy machine may leave a page no time to renew within 2 s.
    """
    if slow:
        stand_still(page, 0.6)
    holder = who_controls(page)
    for _ in range(10):
        # The gateway refuses control while a busy disk takes longer than a second for the audit log.
        page.get_by_label("Your name").fill(name)
        button(page, "Take control").click()
        with suppress(AssertionError):
            expect(holder).to_have_text("You are in control", timeout=6000)
            return
    expect(holder).to_have_text("You are in control")


def ready(page, name="li"):
    """Acquire control, reset a latched stop, and home."""
    take(page, name)
    reset = page.get_by_role("button", name=re.compile("^Reset"))
    home, notice = button(page, "Home"), control_notice(page)
    # The page shows the newest state that it received: a stop sent just before may still arrive.
    for _ in range(100):
        if reset.count() and reset.first.is_enabled():
            reset.first.click()
        # Not done if the page locked motion, for a picture that is late, between the click and its effect, or
        # if a busy disk takes longer than a second for the audit log.
        with suppress(Error, AssertionError):
            home.click(timeout=500)
            expect(notice).to_have_text(re.compile("^(Sent|Done|Not sent)"), timeout=6000)
            expect(notice).not_to_have_text(re.compile("^Sent"))
            if notice.inner_text().startswith("Done"):
                break
        page.wait_for_timeout(200)
    # The values may be those of an arm that is home already, and does not move yet.
    expect(joint_values(page)).to_have_text(HOME)
    expect(page.get_by_text("· homed")).to_be_visible()
    expect(state_word(page)).to_have_text("Idle")


def sent(page, do):
    """Execute an action that sends a command; repeat it if a slow machine sends the command after its
    not_after.
    """
    notice = control_notice(page)
    for _ in range(20):
        do()
        expect(notice).to_have_text(re.compile("^(Sent|Done|Not sent)"))
        if not notice.inner_text().startswith("Not sent"):
            return
    raise AssertionError(notice.inner_text())


def set_speed(page, percent):
    def enter():
        page.get_by_label("Speed").fill(str(percent))
        page.get_by_label("Speed").press("Enter")

    sent(page, enter)


def move_slowly(page):
    """Start one motion of more than half a minute, at 0.9 degrees a second."""
    set_speed(page, 1)
    wait_to_move(page, "waist", lambda: drag(page, "waist", 60))
    expect(state_word(page)).to_have_text("Moving")


def reset_stop(page):
    """Reset the stop; it is refused while the arm still moves, and on a busy machine that is seen late."""
    for _ in range(5):
        page.get_by_role("button", name="Reset stop").click()
        with suppress(AssertionError):
            return expect(stop_panel(page)).to_have_count(0, timeout=10_000)
    raise AssertionError(stop_panel(page).inner_text())


def clear_stop(page):
    reset_stop(page)
    set_speed(page, 100)
    button(page, "Release").click()


@contextmanager
def fault(plant, name):
    """Set a fault in the arm's simulated controller."""
    key = "robomesh/hall/arm/simulator/fault"
    plant.call(plant.session.ask(key, FaultRequest(fault=name)))
    try:
        yield
    finally:
        plant.call(plant.session.ask(key, FaultRequest(fault=name, off=True)))


def degrees(page, joint):
    text = joint_value(page, joint).inner_text()
    return float(text.replace("°", "").replace("−", "-"))


def wait_to_move(page, joint, do):
    """Do something, and wait until the joint is elsewhere: a short motion may be over before it is seen.

    It is done again where the joint does not move: a busy machine may send it after its not_after.
    """
    position = joint_value(page, joint)
    before = position.inner_text()
    for _ in range(5):
        do()
        with suppress(AssertionError):
            expect(position).not_to_have_text(before, timeout=15_000)
            return
    expect(position).not_to_have_text(before)


def audited(plant, request):
    """Return the number of these requests in the gateway's audit log."""
    text = (plant.audit / "hall" / "arm.jsonl").read_text() if (plant.audit / "hall").exists() else ""
    return text.count(f'"{request}"')


def box_of(element):
    """Return where an element is; the page takes a handle away while its picture is late."""
    for _ in range(100):
        expect(element).to_be_visible()
        box = element.bounding_box()
        if box:
            return box
    raise AssertionError(f"{element} has no place")


def drag(page, joint, pixels, *, release=True):
    slider = page.get_by_role("slider", name=f"Target of {joint}")
    box = box_of(slider)
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + pixels, y, steps=4)
    if release:
        page.mouse.up()


def keep_picture(page, name):
    """Keep pictures of a page as `<name>-<width>.png`."""
    size = page.viewport_size
    PICTURES.mkdir(exist_ok=True)
    for width, height in PICTURE_SIZES:
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_timeout(300)  # a drawing on a canvas follows its size
        page.screenshot(path=PICTURES / f"{name}-{width}.png")
    page.set_viewport_size(size)


def serious(page, within="html"):
    """Return axe's serious findings on the page, or on a part of it.

    The page is blocked during the check. On a busy machine a whole page takes longer than a lease lasts.
    """
    if not page.evaluate("'axe' in window"):
        page.evaluate((build_page.MODULES / "axe-core" / "axe.min.js").read_text())
    found = page.evaluate("within => axe.run(within, {resultTypes: ['violations']})", within)
    return [
        (each["id"], node["html"][:120], node["failureSummary"])
        for each in found["violations"]
        if each["impact"] in ("serious", "critical")
        for node in each["nodes"]
    ]
