"""A robot defined on the page, started in addition to a running site's own; all processes are real."""

import json
import signal
import subprocess
import time
from pathlib import Path

import pytest

from robomesh.schemas.robomesh_pb2 import ControllerState
from robomesh.wire.session import open_session
from tests.conftest import run
from tests.services.defining import Page
from tests.site import alive, kill, robomesh, running_site, wait_until

pytestmark = pytest.mark.processes


def programs(site) -> dict[str, int]:
    """Return the process ids of all that `up` runs, by service and robot: "gateway mine"."""
    named = {}
    for pid, (service, *words) in site.services():
        robot = words[words.index("--started") + 1] if "--started" in words else ""
        if service == "simulate" and any("mine" in word for word in words):
            robot = "mine"
        named[f"{service} {robot}".strip()] = pid
    return named


def on_the_mesh(site) -> dict[str, str]:
    """Return each robot's link to its controller."""

    async def look():
        async with open_session(site.mesh) as session:
            robots = [
                who.robot for who in await session.present() if who.service == "gateway" and who.robot != "-"
            ]
            states = [await session.last(f"robomesh/test/{robot}/controller") for robot in robots]
            links = [ControllerState.Link.Name(each.link).lower() if each else "" for each in states]
            return dict(zip(robots, links, strict=True))

    return run(look())


def answers(page: Page) -> bool:
    """Return whether the console runs."""
    try:
        return page.get("/robots").status == 200
    except OSError:
        return False


def descendants(pid: int) -> list[int]:
    """Return every process below one."""
    found = subprocess.run(["ps", "--ppid", str(pid), "-o", "pid="], capture_output=True, text=True).stdout
    children = [int(word) for word in found.split()]
    return [*children, *(below for child in children for below in descendants(child))]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    with running_site(tmp_path_factory.mktemp("site"), services=["recorder", "renderer"]) as running:
        yield running


@pytest.fixture(scope="module")
def page(site):
    return Page(site.console.rstrip("/"), site.folder)


@pytest.fixture(scope="module")
def mine(site, page):
    """Return a started robot named mine."""
    before = programs(site)
    draft = page.draft(name="mine")
    assert page.post("/save", draft).status == 200
    assert page.post("/start", {"name": "mine"}).status == 200
    wait_until(lambda: on_the_mesh(site).get("mine") == "up")
    after = programs(site)
    assert {name: after[name] for name in before} == before, "nobody else was disturbed"
    assert set(after) - set(before) == {"simulate mine", "gateway mine", "kinematics mine"}
    return draft


def test_it_is_commanded_drawn_and_recorded_as_any_other(site, page, mine, tmp_path):
    assert site.command("send", "mine", "home").returncode == 0
    picture = tmp_path / "front.png"
    assert site.command("snapshot", "mine", "front", str(picture)).returncode == 0
    assert picture.read_bytes()[:4] == b"\x89PNG"
    assert site.command("send", "mine", "trace", "on").returncode == 0
    wait_until(lambda: list((site.folder / "recordings" / "mine").glob("*.mcap")))
    assert site.command("send", "mine", "move", "10", "80", "-80", "0", "0").returncode == 0
    assert site.command("send", "mine", "trace", "off").returncode == 0

    def recorded():
        rows = site.command("recordings", "list", "--json").stdout.splitlines()
        return [row for row in map(json.loads, rows) if row["robot"] == "mine" and not row["open"]]

    wait_until(recorded)
    counts = {topic["topic"].rsplit("/", 1)[-1]: topic["messages"] for topic in recorded()[0]["topics"]}
    assert counts["joints"] > 12
    assert robomesh("audit", "verify", str(site.folder / "audit" / "test" / "mine.jsonl")).returncode == 0


@pytest.mark.long
def test_saving_a_started_robot_restarts_only_that_robot(site, page, mine):
    before = programs(site)
    mine["description"]["joint"][0]["limits"] = [-60, 60]
    assert page.post("/save", mine | {"overwrite": True}).status == 200
    own = {"simulate mine", "gateway mine", "kinematics mine"}
    wait_until(lambda: own & set(programs(site)) == own and not any(alive(before[name]) for name in own))
    wait_until(lambda: on_the_mesh(site).get("mine") == "up")
    after = programs(site)
    assert {name: pid for name, pid in after.items() if name not in own} == {
        name: pid for name, pid in before.items() if name not in own
    }
    assert site.command("send", "mine", "home").returncode == 0
    refused = site.command("send", "mine", "move", "61", "80", "-80", "0", "0")
    assert refused.returncode == 1
    assert "60.00" in refused.stdout


@pytest.mark.long
@pytest.mark.parametrize("name", ["gateway mine", "simulate mine", "console"])
def test_a_killed_process_is_restarted(site, page, mine, name):
    before = programs(site)
    workers = descendants(before["console"])
    kill(before[name])
    wait_until(lambda: programs(site).get(name, before[name]) != before[name])
    wait_until(lambda: on_the_mesh(site).get("mine") == "up")
    if name == "console":
        wait_until(lambda: not any(map(alive, workers)), what="its workers outlive it")
        wait_until(lambda: answers(page))
    else:
        assert programs(site)["gateway"] == before["gateway"]


def test_a_half_edited_file_ends_nothing(site, page, mine):
    file = site.folder / "robots" / "started.toml"
    text, before = file.read_text(), programs(site)
    lines = len(site.log)
    file.write_text(text + "[[robot]]\nname = ")
    wait_until(
        lambda: any("robots that were started before keep running" in line for line in site.log[lines:])
    )
    assert programs(site) == before
    answer = page.post("/stop", {"name": "mine"})
    assert answer.status == 409
    assert "started.toml: not TOML" in answer.text
    file.write_text(text)


@pytest.mark.long
def test_a_robot_that_cannot_start_stops_nothing_and_starts_when_it_is_mended(site, page, mine):
    broken = site.folder / "robots" / "broken" / "robot.toml"
    broken.parent.mkdir()
    broken.write_text("name = 5")
    file = site.folder / "robots" / "started.toml"
    text = file.read_text()
    file.write_text(text + '\n[[robot]]\nname = "broken"\nmodel = "broken/robot.toml"\n')
    wait_until(
        lambda: any(line.startswith("gateway broken") and "could not start" in line for line in site.log)
    )
    assert on_the_mesh(site)["mine"] == "up"
    draft = page.draft(name="broken")
    assert page.post("/save", draft | {"overwrite": True}).status == 200
    wait_until(lambda: on_the_mesh(site).get("broken") == "up")
    assert page.post("/stop", {"name": "broken"}).status == 200
    wait_until(lambda: "broken" not in on_the_mesh(site))


def test_taken_out_its_processes_end(site, page, mine):
    before = programs(site)
    assert page.post("/stop", {"name": "mine"}).status == 200
    wait_until(lambda: not any(alive(pid) for name, pid in before.items() if name.endswith(" mine")))
    wait_until(lambda: "mine" not in on_the_mesh(site))
    assert on_the_mesh(site)["arm"] == "up"


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_it_is_there_at_the_next_up_and_nothing_is_left_after(site, page, mine, number, tmp_path):
    folder = tmp_path / "second"
    robots = folder / "robots"
    robots.mkdir(parents=True)
    (site.folder / "robots" / "mine").rename(robots / "mine")
    try:
        (robots / "started.toml").write_text(
            'site = "test"\n[[robot]]\nname = "mine"\nmodel = "mine/robot.toml"\n'
        )
        begun = time.monotonic()
        with running_site(folder, services=()) as second:
            started_s = time.monotonic() - begun
            other = Page(second.console.rstrip("/"), folder)
            other.post("/check", other.draft())
            wait_until(lambda: on_the_mesh(second).get("mine") == "up")
            # 5 of the site, 3 of the robot, Define's worker, and each gateway's checker.
            wait_until(lambda: len(descendants(second.process.pid)) >= 11)
            everything = descendants(second.process.pid)
            begun = time.monotonic()
            second.process.send_signal(number)
            second.process.wait(60.0)
            if number == signal.SIGINT:
                assert time.monotonic() - begun < started_s
            wait_until(lambda: not any(map(alive, everything)))
    finally:
        Path(robots / "mine").rename(site.folder / "robots" / "mine")
