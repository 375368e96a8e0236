"""Clicks and typed fields that each task of the page takes.

A browser performs the tasks at a site of real processes, one after another as an operator would. A text that
is typed counts as a field, a held button and a dragged slider as a click.

    ./dev run python -m benchmarks clicks [--json]
"""

import re
import time
from collections.abc import Callable

from playwright.sync_api import Error, Locator, Page, expect

from benchmarks.page.browser import NO_WEBGL, PATIENCE_MS, chromium, site_for_page

ROBOTS = "".join(f'[[robot]]\nname = "{name}"\nmodel = "pt600"\n' for name in ("left", "right"))
PROGRAM = "home\nwait 1\n"
DONE = re.compile("Sent:|Done")


class User:
    """User of the page, with counters of clicks and typed fields."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.clicks = self.fields = 0

    def click(self, what: Locator) -> None:
        what.click()
        self.clicks += 1

    def press(self, name: str | re.Pattern[str], within: Page | Locator | None = None) -> None:
        """Press a button."""
        exact = isinstance(name, str)
        self.click((within or self.page).get_by_role("button", name=name, exact=exact).first)

    def open(self, name: str | re.Pattern[str]) -> None:
        """Follow a link."""
        exact = isinstance(name, str)
        self.click(self.page.get_by_role("link", name=name, exact=exact).first)

    def type(self, label: str, text: str, within: Page | Locator | None = None) -> None:
        (within or self.page).get_by_label(label, exact=True).first.fill(text)
        self.fields += 1

    def choose(self, label: str, value: str) -> None:
        """Choose from a list."""
        self.page.get_by_label(label, exact=True).first.select_option(value)
        self.clicks += 1


# ------------------------------------------------------------------ tasks


def open_robot(user: User) -> None:
    user.open(re.compile("left"))
    expect(user.page.get_by_text("waist").first).to_be_visible()


def switch_robot(user: User) -> None:
    user.press(re.compile("Choose another robot"))
    user.click(user.page.get_by_role("option", name=re.compile("^right")))
    expect(user.page.get_by_role("heading", name="right", exact=True)).to_be_visible()
    user.page.go_back()


def take_control(user: User) -> None:
    user.type("Your name", "li")
    user.press("Take control")
    expect(user.page.get_by_text("You are in control")).to_be_visible()


def home(user: User) -> None:
    user.press("Home")
    expect(user.page.get_by_text("· homed", exact=False).first).to_be_visible()


def set_speed(user: User) -> None:
    slider = user.page.get_by_role("slider", name=re.compile("^Speed"))
    slider.focus()
    user.click(slider)
    expect(slider).not_to_have_accessible_name(re.compile("not known"))


def step_joint(user: User) -> None:
    user.press("waist +1°")
    expect(user.page.get_by_role("region", name="Joints").get_by_role("status").first).to_contain_text(DONE)


def jog(user: User) -> None:
    tool = user.page.get_by_role("region", name="Tool")
    user.press("Jog", tool)
    button = tool.get_by_role("button", name="Tool Z −")
    expect(button).to_be_enabled()
    button.hover()
    user.page.mouse.down()
    time.sleep(1)
    user.page.mouse.up()
    user.clicks += 1
    expect(tool.get_by_role("status").first).to_contain_text("Ended")


def stop(user: User) -> None:
    user.press(re.compile("^Stop request"))
    expect(user.page.get_by_role("button", name=re.compile("^Reset stop"))).to_be_enabled()


def reset_stop(user: User) -> None:
    button = user.page.get_by_role("button", name=re.compile("^Reset stop"))
    user.click(button)
    expect(button).to_have_count(0)


def release(user: User) -> None:
    user.press("Release")
    expect(user.page.get_by_role("button", name="Take control")).to_be_visible()


def look_from_above(user: User) -> None:
    user.press("Top")


def start_recording(user: User) -> None:
    user.press("Record…")
    user.press("Record", user.page.get_by_role("region", name="Record…"))
    expect(user.page.get_by_role("button", name=re.compile("^Stop$|^Stop recording"))).to_be_visible()


def stop_recording(user: User) -> None:
    time.sleep(3)
    user.press(re.compile("^Stop$|^Stop recording"))


def write_note(user: User) -> None:
    user.press("Note…")
    form = user.page.get_by_role("form", name="Note")
    user.type("Text", "gripper slips", form)
    user.press("Save note")
    expect(form).to_have_count(0)


def plot_field(user: User) -> None:
    user.press("Fields of plot 1")
    user.type("Filter values", "tool x")
    user.click(user.page.get_by_role("region", name="Plot 1").get_by_role("checkbox").first)
    user.press("Fields of plot 1")


def plot_longer(user: User) -> None:
    user.choose("Time range of plot 1", "300")


def save_layout(user: User) -> None:
    user.press("Layout…")
    form = user.page.get_by_role("form", name=re.compile("^Layouts saved"))
    user.type("Name", "mine", form)
    user.press("Save layout")
    expect(form.get_by_role("status")).to_contain_text("Saved")


def write_program(user: User) -> None:
    user.open("Program")
    editor = user.page.get_by_role("textbox", name="Program text")
    editor.fill(PROGRAM)
    user.fields += 1
    expect(editor).to_have_value(PROGRAM)


def save_program(user: User) -> None:
    user.type("Program name", "pick")
    user.press("Save")
    expect(user.page.get_by_text(re.compile("^Saved")).first).to_be_visible()


def run_program(user: User) -> None:
    user.press("Take control")
    user.press(re.compile("^Run"))
    expect(user.page.get_by_role("button", name="Release")).to_be_visible()
    time.sleep(8)
    user.press("Release")


def play_recording(user: User) -> None:
    user.open("Recordings")
    user.open(re.compile("^Play"))
    expect(user.page.get_by_role("slider").first).to_be_visible()


def export_range(user: User) -> None:
    with user.page.expect_download():
        user.click(user.page.get_by_text("CSV of this part"))


def see_alarms(user: User) -> None:
    user.open(re.compile("alarm"))
    expect(user.page.get_by_role("heading", name="Alarms")).to_be_visible()


def see_day(user: User) -> None:
    user.press("Day")


def see_requests(user: User) -> None:
    user.press("Requests")


def see_wall(user: User) -> None:
    user.open("Wall")
    expect(user.page.get_by_role("article").first).to_be_visible()


def define_like(user: User) -> None:
    user.open("New robot")
    user.open(re.compile("Puma 560"))
    expect(user.page.get_by_role("table").first).to_be_visible()


def see_health(user: User) -> None:
    user.open("Settings")
    expect(user.page.get_by_role("rowheader", name=re.compile("gateway"))).to_be_visible()


# In this order: some begin where the one before ended.
TASKS: dict[str, Callable[[User], None]] = {
    "Fleet: open a robot": open_robot,
    "Robot: go to another robot": switch_robot,
    "Robot: take control": take_control,
    "Robot: home": home,
    "Robot: set the speed": set_speed,
    "Robot: move a joint by a step": step_joint,
    "Robot: jog the tool": jog,
    "Robot: request a stop": stop,
    "Robot: reset the stop": reset_stop,
    "Robot: release control": release,
    "Robot: look from above": look_from_above,
    "Robot: start a recording": start_recording,
    "Robot: stop it": stop_recording,
    "Robot: write a note": write_note,
    "Robot: plot another value": plot_field,
    "Robot: plot 5 minutes": plot_longer,
    "Robot: save the layout at the site": save_layout,
    "Program: write one": write_program,
    "Program: save it at the site": save_program,
    "Program: take control, run, release": run_program,
    "Recordings: play one, from any page": play_recording,
    "Player: save it as CSV": export_range,
    "Events: see the alarms, from any page": see_alarms,
    "Events: see the day": see_day,
    "Events: see the requests": see_requests,
    "Wall: see each robot, from any page": see_wall,
    "New robot: begin with a known one": define_like,
    "Settings: see the services' health": see_health,
}


def measure() -> dict[str, str | dict[str, int]]:
    """Perform each task; a task that fails says why."""
    result: dict[str, str | dict[str, int]] = {}
    with site_for_page(ROBOTS) as site, chromium() as browser:
        page = browser.new_page(viewport={"width": 1440, "height": 900}, locale="en-GB")
        page.add_init_script(NO_WEBGL)
        page.set_default_timeout(PATIENCE_MS)
        page.goto(site.console)
        for name, task in TASKS.items():
            user = User(page)
            try:
                task(user)
            except (AssertionError, Error) as error:
                result[name] = f"failed: {str(error).splitlines()[0]}"
            else:
                result[name] = {"clicks": user.clicks, "fields": user.fields}
    return result
