"""SNPX with programs of others; each test is skipped without its program (CONTRIBUTING.md)."""

import asyncio
import contextlib
import importlib.util
import json
import math
import os
import sys

import pytest

from controllers.fanuc.axes import FanucSettings
from controllers.fanuc.driver import SnpxDriver
from protocol_gateway.link.link import ControllerLink, LinkSettings
from protocol_gateway.seam import (
    AlarmReceived,
    JointsReceived,
    MalformedReceived,
    StatusReceived,
)
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of, violations
from robots.kinematics.model import build_model, tool_placement
from tests.controllers.fanuc.test_snpx_driver import controller
from tests.protocol_gateway.gateway_site import until
from tests.protocol_gateway.scripted_controller import endless_joints

pytestmark = pytest.mark.slow

PUMA = joints_of(load("puma560"))
SERVER = os.environ.get("SNPX_SERVER", "")
# fanuc-ucl knows one port only; an address of loopback for this test alone keeps it free.
UCL_HOST = "127.60.0.8"
READ_UCL = """
import json, sys
from fanuc_ucl import hmi
driver = hmi.HmiDriver(sys.argv[1])
driver.connect(timeout_secs=20.0)
within = {"timeout_secs": 20.0}
def read(handle):
    return handle.wait_timeout(20.0)
position = driver.register_asg(hmi.PositionData, True, frame=0, group=1, **within)
alarm = driver.register_asg(hmi.AlarmData, source=hmi.AlarmSource.Active, line=1, **within)
program = driver.register_asg(hmi.ProgramStatus, task=1, kind=hmi.ProgramStatusKind.Default, **within)
register = driver.register_asg(float, index=1, **within)
override = driver.register_sysvar_asg(int, name="$MCR.$GENOVERRIDE", **within)
offset = driver.register_sysvar_asg(hmi.PositionData, name="$MNUTOOL[1,1]", **within)
found = read(position.read(driver))
joint, cartesian = found.joint, found.cartesian
alarm = read(alarm.read(driver))
program = read(program.read(driver))
print(json.dumps({
    "axes": [getattr(joint, f"j{number}") for number in range(1, 10)],
    "pose": [getattr(cartesian, name) for name in "xyzwpr"],
    "up": str(cartesian.ud),
    "alarm": [alarm.id, alarm.number, str(alarm.severity), alarm.msg],
    "program": [program.name, program.line_number, str(program.state)],
    "register": read(register.read(driver)),
    "override": read(override.read(driver)),
    "tool": read(offset.read(driver)).cartesian.z,
    "uo": read(driver.read(hmi.UopOutput, 1, 20))[:20],
    "di": read(driver.read(hmi.DigitalInput, 1, 16))[:16],
}))
"""
READ_CLIENT = """
import json, sys
from snpx_client import SnpxClient
client = SnpxClient(ip="127.0.0.1", port=int(sys.argv[1]), connect_on_init=True)
print(json.dumps({"axes": client.j_pos.read(), "di": client.di.read(16), "do": client.do.read(16)}))
client.disconnect()
"""


async def output_of(*command):
    """Return what a program prints."""
    process = await asyncio.create_subprocess_exec(
        *command, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE
    )
    output, errors = await process.communicate()
    assert process.returncode == 0, errors.decode()
    return json.loads(output.splitlines()[-1])


def model_positions(axes):
    """Return positions of the model's joints; axis 3 is measured against the horizontal."""
    degrees = [axes[0], axes[1], axes[2] + axes[1], *axes[3:6]]
    return [math.radians(each) for each in degrees]


@pytest.mark.skipif(importlib.util.find_spec("fanuc_ucl") is None, reason="fanuc_ucl is not installed")
async def test_fanuc_ucl_reads_the_simulated_controller():
    async with controller(listen=f"{UCL_HOST}:60008", faults=("fault",)):
        found = await output_of(sys.executable, "-c", READ_UCL, UCL_HOST)
    assert model_positions(found["axes"]) == pytest.approx(PUMA.home, abs=1e-6)
    placement = tool_placement(build_model(load("puma560")), PUMA.home)
    assert found["pose"][:3] == pytest.approx(placement[:3, 3] * 1000, abs=0.01)
    assert found["up"] == "Up"
    assert found["alarm"] == [11, 1, "ServoAlarm", "SRVO-001 Operator panel E-stop"]
    assert found["program"] == ["DEMO", 1, "Paused"]
    assert (found["register"], found["override"]) == (12.5, 100)
    # FAULT is on, SYSRDY and CMDENBL are off.
    assert found["uo"] == [number == 6 for number in range(1, 21)]
    assert found["di"] == [False] * 16


@pytest.mark.skipif(
    importlib.util.find_spec("snpx_client") is None, reason="snpx_client.py is not on the PYTHONPATH"
)
async def test_snpx_client_reads_the_simulated_controller():
    async with controller(demo=True) as port:
        found = await output_of(sys.executable, "-c", READ_CLIENT, str(port))
    assert not violations(PUMA, model_positions(found["axes"]))
    assert found["di"] == found["do"]
    assert len(found["di"]) == 16


@pytest.mark.skipif(
    not SERVER,
    reason="SNPX_SERVER does not name the program of snpx_server beside this file, which uses fanuc_ucl",
)
async def test_a_server_with_fanuc_ucl_reads_every_packet_of_the_driver():
    events = []
    server = await asyncio.create_subprocess_exec(SERVER, stdout=asyncio.subprocess.PIPE)
    port = int(await server.stdout.readline())
    settings = FanucSettings(assignments="own", j23=1, registers=(5, 7))
    driver = SnpxDriver(PUMA.types, {}, options=settings)
    link = ControllerLink(
        LinkSettings(host="127.0.0.1", port=port),
        driver,
        endless_joints(6),
        on_event=lambda event, _: events.append(event),
    )
    task = asyncio.create_task(link.run())
    try:
        await until(lambda: sum(isinstance(each, JointsReceived) for each in events) > 40)
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
        server.terminate()
        lines = (await server.stdout.read()).decode().splitlines()
        await server.wait()
    events, lines, table = events, lines, settings.table
    commands = ["CLRASG", *(each.command for each in table.assignments)]
    assert lines[: 2 + len(commands)] == ["init", "session", *commands]
    # The robot's outputs are the inputs of the PLC, as fanuc_ucl names them here.
    asked = {f"read words {each.first_word - 1} {each.words}" for each in table.blocks}
    asked |= {f"read InputBit {first} {count}" for first, count in ((0, 16), (5000, 8), (6000, 24))}
    asked |= {f"read OutputBit {first} {count}" for first, count in ((0, 16), (5000, 8))}
    assert {*lines[2 + len(commands) :]} == asked
    (positions,) = {each.positions for each in events if isinstance(each, JointsReceived)}
    assert positions == pytest.approx([math.radians(each) for each in (10, 20, -10, 40, -50, 60)])
    assert any(isinstance(each, StatusReceived) and each.activity is not None for each in events)
    assert not any(isinstance(each, AlarmReceived | MalformedReceived) for each in events)
