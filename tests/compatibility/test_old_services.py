"""Services of an earlier version work together with those of this one, at one site."""

import asyncio
import json
import subprocess
import sys
from contextlib import ExitStack, contextmanager

import pytest

from robomesh.schemas import robomesh_pb2 as schema
from tests.compatibility.earlier import EarlierVersion, end, in_log, unpack
from tests.ports import free_port
from tests.services.test_console import browse
from tests.site import RATE_HZ, robomesh, wait_until

pytestmark = [pytest.mark.long, pytest.mark.processes]

SITE = """
site = "plant"

[router]
listen = ["{router}"]

[[robot]]
name = "{robot}"
model = "pt600"
controller = "tcp://127.0.0.1:{controller}"
stop_proven = true
accept_unknown = ["mode", "homed"]

[recorder]
folder = "recordings-{robot}"
flight = {{ minutes = 0 }}

[console]
listen = "127.0.0.1:{console}"
"""


@contextmanager
def process(log, *arguments):
    """Run a service of this version; end it when the block ends."""
    with log.open("wb") as output:
        running = subprocess.Popen(
            [sys.executable, "-m", "services.command_line.main", *arguments],
            stdout=output,
            stderr=subprocess.STDOUT,
        )
        try:
            yield running
        finally:
            end(running)


class Plant:
    """One site: robot `now` has services of this version, robot `then` of the earlier one."""

    def __init__(self, folder):
        self.folder = folder
        self.router = f"tcp/127.0.0.1:{free_port()}"
        self.earlier = EarlierVersion(unpack("services-2026-11-22.tar.xz", folder / "earlier"))
        page = self.earlier.folder / "services" / "console" / "page" / "dist"
        page.mkdir(parents=True)
        (page / "index.html").write_text("<!doctype html>")
        self.controllers = {robot: free_port() for robot in ("now", "then")}
        self.consoles = {robot: free_port() for robot in ("now", "then")}

    def file(self, robot):
        """Write and return the site file with one of the two robots."""
        path = self.folder / f"{robot}.toml"
        path.write_text(
            SITE.format(
                router=self.router,
                robot=robot,
                controller=self.controllers[robot],
                console=self.consoles[robot],
            )
        )
        return str(path)

    def now(self, *arguments, timeout_s=60.0):
        """Run a command of this version."""
        return robomesh(*arguments, "--connect", self.router, timeout_s=timeout_s)

    def then(self, *arguments, timeout_s=60.0):
        """Run a command of the earlier version."""
        return self.earlier.robomesh(*arguments, "--connect", self.router, timeout_s=timeout_s)


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    folder = tmp_path_factory.mktemp("two-versions")
    made = Plant(folder)
    files = {robot: made.file(robot) for robot in ("now", "then")}
    with ExitStack() as running:
        start = running.enter_context
        for robot, port in made.controllers.items():
            words = ("simulate", "--listen", f"127.0.0.1:{port}", "--rate", f"{RATE_HZ:g}")
            start(process(folder / f"simulate-{robot}.log", *words))
        start(process(folder / "router.log", "router", "--site", files["now"]))
        connect = ("--connect", made.router)
        for service in ("gateway", "kinematics", "recorder", "console"):
            start(process(folder / f"{service}-now.log", service, "--site", files["now"], *connect))
            log = folder / f"{service}-then.log"
            start(made.earlier.service(log, service, "--site", files["then"], *connect))
        for robot in files:
            in_log(folder / f"console-{robot}.log", "console http")

        def links():
            done = made.now("list", "--json")
            found = json.loads(done.stdout)["robots"] if done.returncode == 0 else []
            return {robot["robot"]: robot["link"] for robot in found}

        wait_until(lambda: links() == {"now": "up", "then": "up"}, timeout_s=90.0)
        yield made


@pytest.fixture(params=["now", "then"])
def either(request, plant):
    """Return the command line of each version."""
    return getattr(plant, request.param)


def test_each_command_line_lists_monitors_and_moves_robots_of_both_gateways(plant, either):
    listed = json.loads(either("list", "--json").stdout)
    assert {robot["robot"]: robot["link"] for robot in listed["robots"]} == {"now": "up", "then": "up"}
    for robot in ("now", "then"):
        state = json.loads(either("monitor", robot, "--json", "--count", "1").stdout)
        assert len(state["joints"]) == 5
        home = either("send", robot, "home")
        assert home.returncode == 0, home.stderr + home.stdout


def test_each_command_line_is_refused_in_words_by_both_gateways(plant, either):
    for robot in ("now", "then"):
        refused = either("send", robot, "move", "1000", "0", "0", "0", "0", "--json")
        assert refused.returncode == 1, refused.stderr
        assert "limit" in json.loads(refused.stdout.splitlines()[-1])["text"]


def test_a_stop_of_each_version_latches_at_both_gateways_until_the_other_resets_it(plant):
    for stopping, other in ((plant.then, plant.now), (plant.now, plant.then)):
        for robot in ("now", "then"):
            assert stopping("send", robot, "stop").returncode == 0
            refused = other("send", robot, "home")
            assert refused.returncode == 1
            assert "latched" in refused.stdout + refused.stderr
            assert other("send", robot, "reset").returncode == 0


def test_each_command_line_reads_the_audit_of_both_gateways(plant, either):
    for robot in ("now", "then"):
        assert either("send", robot, "home").returncode == 0
        done = either("audit", "list", f"plant/{robot}", "--json")
        requests = [json.loads(line)["request"] for line in done.stdout.splitlines()]
        assert {"ACQUIRE", "HOME", "RELEASE"} <= set(requests)


def test_each_recorder_records_for_the_command_line_of_the_other(plant, tmp_path):
    for recording, other, robot in ((plant.now, plant.then, "then"), (plant.then, plant.now, "now")):
        for action in ("on", "off"):
            done = recording("send", robot, "trace", action)
            assert done.returncode == 0, done.stderr + done.stdout

        def counted(robot=robot, other=other):
            listed = other("recordings", "list", "--json")
            return f'"{robot}"' in listed.stdout

        wait_until(counted, timeout_s=90.0)


@pytest.mark.parametrize("version", ["now", "then"])
def test_a_page_at_each_console_sees_and_stops_robots_of_both_gateways(plant, version):
    async def main():
        async with browse(f"127.0.0.1:{plant.consoles[version]}") as page:
            for robot in ("now", "then"):
                key = f"robomesh/plant/{robot}"
                await page.watch(f"{key}/joints")
                await page.until(
                    lambda key=key: any(each.live for each in page.samples if each.key == f"{key}/joints")
                )
            for number, robot in enumerate(("now", "then"), 1):
                request = schema.StopRequest(by="page", reason="a test").SerializeToString()
                answer = await page.ask(number, f"robomesh/plant/{robot}/stop", request, timeout_s=20.0)
                assert answer.ok, answer

    asyncio.run(asyncio.wait_for(main(), 120.0))
    for robot in ("now", "then"):
        assert plant.now("send", robot, "reset").returncode == 0
