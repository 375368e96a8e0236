"""A controller with another protocol needs one driver in an installed package: examples/driver/."""

import asyncio
import contextlib
import json
import math
import os
import subprocess
import sys
import types
from importlib import metadata
from pathlib import Path

import pytest

from protocol_gateway.configuration.kinds import driver_maker, protocols
from protocol_gateway.seam import (
    Hold,
    JointsReceived,
    MalformedReceived,
    MoveAbsolute,
    Refused,
    Stop,
)
from protocol_gateway.seam.errors import CommandError, GatewaySettingsError
from robomesh.schemas import robomesh_pb2 as schema
from robots.kinematics.joints import JointType
from services.errors import SiteFileError
from services.site_file.site import load
from tests.protocol_gateway.gateway_site import PROMPT, STATE, A, C, gateway, refusal, until
from tests.serving import serving

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "driver"
ENTRY_POINTS = "[robomesh.drivers]\njson-lines = json_lines:JsonLines\nbroken = no_such_module:Driver\n"
SITE = 'site = "hall"\n[[robot]]\nname = "arm"\nmodel = "pt600"\nprotocol = "{}"\ncontroller = "{}"\n'


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Install the example as a package does: its module, and its entry points."""
    folder = tmp_path / "packages"
    information = folder / "robomesh_json_lines-0.1.0.dist-info"
    information.mkdir(parents=True)
    (information / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: robomesh-json-lines\nVersion: 0.1.0\n"
    )
    (information / "entry_points.txt").write_text(ENTRY_POINTS)
    monkeypatch.syspath_prepend(str(EXAMPLE))
    monkeypatch.syspath_prepend(str(folder))
    yield
    sys.modules.pop("json_lines", None)


@contextlib.asynccontextmanager
async def json_controller():
    """Run a controller that speaks JSON and executes commands immediately: (port, received commands)."""
    heard, state = [], {"q": [0.1] * 5, "state": "idle", "remote": True, "homed": True}

    async def listen(reader):
        async for line in reader:
            for what in json.loads(line)["do"]:
                heard.append(what)
                if what == "stop":
                    state["state"] = "stopped"
                elif what == "reset":
                    state["state"] = "idle"
                elif "to" in what:
                    state["q"] = what["to"]

    async def serve(reader, writer):
        listening = asyncio.create_task(listen(reader))
        try:
            while not listening.done():
                writer.write(json.dumps(state).encode() + b"\n")
                await asyncio.sleep(0.01)
        finally:
            listening.cancel()

    async with serving(serve) as port:
        yield port, heard, state


async def test_a_robot_of_another_protocol_is_shown_commanded_and_stopped_like_any_other(
    mesh, tmp_path, installed
):
    async with (
        json_controller() as (port, heard, state),
        gateway(mesh, tmp_path, port, protocol="json-lines", **PROMPT) as site,
    ):
        await until(lambda: site.joints == [0.1] * 5)
        # Positions and state are two topics.
        await until(lambda: site.controller.mode == STATE.REMOTE)
        assert site.controller.homed == STATE.YES
        able = site.controller.capabilities
        assert able.stops == schema.Capabilities.ANY
        assert set(able.commands) == {C.HOME, C.RESET, C.MOVE_ABSOLUTE, C.MOVE_RELATIVE, C.RUN_PROGRAM}
        await site.lease(A.ACQUIRE)
        target = [0.2, 0.3, -0.1, 0.1, 0.3]
        await site.command(C.MOVE_ABSOLUTE, joint_positions=target)
        await until(lambda: site.joints == target)
        assert "this controller has no TRACE_ON" in await refusal(site.command(C.TRACE_ON))
        far = [math.radians(170.0), *target[1:]]
        assert "waist" in await refusal(site.command(C.MOVE_ABSOLUTE, joint_positions=far))
        stop = await site.stop(by="wang")
        await until(lambda: site.controller.activity == STATE.STOPPED)
        await asyncio.sleep(0.3)  # this arm jumps: no motion was seen
        await site.lease(A.RENEW)
        await site.command(C.RESET, stop_id=stop.stop_id)
        await until(lambda: heard[-1] == "reset")
        state["q"] = [0.0] * 3
        await until(lambda: site.events("unit.malformed"))
        await until(lambda: site.controller.link == STATE.SILENT)


def test_an_installed_driver_is_a_protocol_of_the_site_file_and_gets_its_table(tmp_path, installed):
    path = tmp_path / "site.toml"
    path.write_text(SITE.format("json-lines", "udp://10.0.0.7:5000") + "[robot.driver]\nlimit = 100\n")
    robot = load(path).robot[0]
    assert (robot.protocol, robot.options) == ("json-lines", {"limit": 100})
    assert protocols()[0] == "unit"
    for text, words in (
        (SITE.format("json-lines", "simulated"), "has no simulator: name its address"),
        (SITE.format("unit", "tcp://10.0.0.7:5000") + "driver = { limit = 1 }\n", "an installed driver"),
        (SITE.format("jsonlines", "tcp://10.0.0.7:5000"), "'unit' or '"),
    ):
        path.write_text(text)
        with pytest.raises(SiteFileError, match=words):
            load(path)


def test_a_driver_that_cannot_be_imported_is_named_with_its_package(installed):
    with pytest.raises(GatewaySettingsError, match=r"'broken'.*robomesh-json-lines.*No module named"):
        driver_maker("broken")
    with pytest.raises(GatewaySettingsError, match=r"unknown protocol 'x'; known: unit, .*, json-lines"):
        driver_maker("x")


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("raise SystemExit('no licence')", "cannot be imported: no licence"),
        ("Driver = 3", "cannot be created: 'int' object is not callable"),
        ("def Driver(*given, **named): raise KeyError('limit')", "cannot be created: 'limit'"),
        ("def Driver(*given, **named): return None", "cannot be created: .*NoneType"),
        ("def Driver(*given, **named): raise SystemExit", "cannot be created"),
    ],
)
def test_a_driver_that_fails_at_the_start_is_named_with_its_package(installed, monkeypatch, lines, words):
    module = types.ModuleType("no_such_module")
    monkeypatch.setattr(metadata.EntryPoint, "load", lambda each: exec(lines, vars(module)) or module.Driver)
    with pytest.raises(GatewaySettingsError, match=f"'broken'.*robomesh-json-lines.*{words}"):
        driver_maker("broken")((), {}, relay=None, options=None)


def test_a_protocol_of_two_packages_is_refused(installed, tmp_path, monkeypatch):
    information = tmp_path / "more" / "other-1.0.dist-info"
    information.mkdir(parents=True)
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: other\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text("[robomesh.drivers]\njson-lines = other:Driver\n")
    monkeypatch.syspath_prepend(str(tmp_path / "more"))
    with pytest.raises(GatewaySettingsError, match=r"'json-lines'.*remove all but one of other, robomesh-"):
        driver_maker("json-lines")


def test_the_example_reports_what_it_can_read_and_names_what_it_cannot(installed):
    make = driver_maker("json-lines")
    driver = make((JointType.ROTARY,) * 2, {}, relay=None, options={"limit": 50})
    (channel,) = (each.channel for each in driver.started(0.0))
    state = b'{"q": [1, 2], "state": "idle", "remote": true, "homed": true}\n{"no": "too fast"}\n'
    (report,) = driver.received(channel, state[:20], 0.0)
    assert report.units == 0
    (report,) = driver.received(channel, state[20:], 0.0)
    assert (report.units, report.refusals, report.events[0]) == (2, 1, JointsReceived((1.0, 2.0)))
    assert report.events[2] == Refused(0, "too fast")
    for wrong in (
        b"[",
        b"1\n",
        b'{"q": [1]}\n',
        b'{"q": [1, 2], "state": "x"}\n',
        b"x" * 60,
        b"[" * 5000 + b"\n",
    ):
        (report,) = driver.received(
            channel, wrong if wrong.endswith(b"\n") or len(wrong) > 50 else wrong + b"\n", 0.0
        )
        assert report.units == 0, wrong
        assert all(isinstance(each, MalformedReceived) for each in report.events)
    assert driver.prepare(MoveAbsolute((0.5, 1.0)), Stop()) == b'{"do": [{"to": [0.5, 1.0]}, "stop"]}\n'
    with pytest.raises(CommandError, match="has no Hold"):
        driver.prepare(Hold())
    with pytest.raises(GatewaySettingsError, match="'limits' is unknown"):
        make((JointType.ROTARY,), {}, relay=None, options={"limits": 1})


OLD = """
import logging
logging.basicConfig()
from protocol_gateway.configuration.kinds import driver_maker
from protocol_gateway.seam import Stop
driver = driver_maker("json-lines")((), {}, relay=None, options=None)
print(driver.command(driver.prepare(Stop()), 0.0)[0].data, driver.timer_ended({}, 0.0))
from protocol_gateway.drivers.only_reads import OnlyReads
from protocol_gateway.configuration.kinds import _with_new_names
class Reads(OnlyReads):
    __slots__ = ()
    def timer_ended(self, now_s):
        return [now_s]
reads = _with_new_names(Reads(), "it")
print(reads.timer_ended({"": 1.0}, 2.0))
"""


@pytest.mark.slow
def test_a_driver_with_the_old_names_runs_with_warnings_that_say_the_new_ones(installed, tmp_path):
    old = (EXAMPLE / "json_lines.py").read_text()
    for new, name in (
        ("protocol_gateway.seam", "protocol_gateway.drivers.driver"),
        ("def prepare(", "def encode("),
        ("ended: Mapping[str, float], ", ""),
    ):
        assert new in old
        old = old.replace(new, name)
    old += "\nfrom protocol_gateway.drivers.only_reads import OnlyReads\n"
    (tmp_path / "packages" / "json_lines.py").write_text(old)
    path = [str(tmp_path / "packages"), *(each for each in sys.path if each != str(EXAMPLE))]
    done = subprocess.run(
        [sys.executable, "-c", OLD],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == 'b\'{"do": ["stop"]}\\n\' ()\n[2.0]\n'
    assert (
        "FutureWarning: protocol_gateway.drivers will be gone: import from protocol_gateway.seam"
        in done.stderr
    )
    assert "of the package robomesh-json-lines, has old methods: encode is prepare now" in done.stderr


KIND = """
from protocol_gateway.seam.kind import Kind
from protocol_gateway.seam.table import Table

class Limit(Table):
    limit: int = 100

    def options(self, robot):
        return {"limit": self.limit, "of": robot.protocol}

KIND = Kind(driver="json_lines:JsonLines", table="json_lines_kind:Limit")
"""


def test_a_kind_of_a_package_checks_its_table_and_makes_the_drivers_settings(
    installed, tmp_path, monkeypatch
):
    (tmp_path / "packages" / "json_lines_kind.py").write_text(KIND)
    information = tmp_path / "packages" / "robomesh_json_lines-0.1.0.dist-info"
    (information / "entry_points.txt").write_text("[robomesh.drivers]\nwith-table = json_lines_kind:KIND\n")
    text = SITE.format("with-table", "tcp://10.0.0.7:5000")
    path = tmp_path / "site.toml"
    for line, options in (("", 100), ("driver = { limit = 7 }", 7)):
        path.write_text(f"{text}{line}\n")
        (robot,) = load(path).robot
        assert robot.options == {"limit": options, "of": "with-table"}
    for line, problem in (("{ limit = 'x' }", "driver.limit"), ("{ limits = 1 }", "driver.limits")):
        path.write_text(f"{text}driver = {line}\n")
        with pytest.raises(SiteFileError, match=problem):
            load(path)
