"""HSES with programs of others; each test is skipped without its program (CONTRIBUTING.md)."""

import asyncio
import contextlib
import importlib.util
import json
import os
import sys

import pytest

from protocol_gateway.drivers.driver import JointsReceived, MalformedReceived, SignalsReceived, StatusReceived
from protocol_gateway.drivers.yaskawa.axes import YaskawaSettings
from protocol_gateway.drivers.yaskawa.driver import HsesDriver
from protocol_gateway.link.link import ControllerLink, LinkSettings
from robots.description import load
from robots.joints import joints_of, violations
from services.simulator.yaskawa.service import with_factors
from tests.conftest import free_port, run
from tests.protocol_gateway.gateway_site import until
from tests.services.test_hses_simulator import simulator

pytestmark = pytest.mark.slow

PUMA = joints_of(load("puma560"))
MOCK = os.environ.get("MOTO_HSES_MOCK", "")
CLIENT = os.environ.get("MOTO_HSES_EXAMPLES", "")
READ = """
import json, sys
from fs100 import FS100
FS100.UDP_PORT_ROBOT_CONTROL = int(sys.argv[1])
FS100._connect.__defaults__ = (int(sys.argv[1]),)
robot = FS100("127.0.0.1")
found = {}
for name, read in {
    "status": robot.get_status, "job": robot.read_executing_job_info, "alarm": robot.get_last_alarm,
    "position": lambda into: robot.read_position(into, 1), "axes": lambda into: robot.read_axis_name(into, 1),
    "torque": robot.read_torque, "past": lambda into: robot.read_alarm_info(1, into),
    "system": lambda into: robot.acquire_system_info(11, into),
}.items():
    found[name] = {}
    assert read(found[name]) == 0, name
io = FS100.Variable(FS100.VarType.IO, 1)
assert robot.read_variable(io) == 0
found["io"] = io.val
assert robot.switch_power(FS100.POWER_TYPE_SERVO, FS100.POWER_SWITCH_ON) == 8
print(json.dumps(found))
"""


async def output_of(*command):
    """Return what a program prints."""
    process = await asyncio.create_subprocess_exec(
        *command,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
        env=os.environ | {"RUST_LOG": "info"},
    )
    output, _ = await process.communicate()
    assert process.returncode == 0, output
    return output.decode()


@pytest.mark.skipif(importlib.util.find_spec("fs100") is None, reason="fs100 is not on the PYTHONPATH")
def test_fs100_reads_the_simulated_controller():
    async def main():
        async with simulator(demo=True, faults=("fault@3",)) as port:
            await asyncio.sleep(0)
            found = json.loads((await output_of(sys.executable, "-c", READ, str(port))).splitlines()[-1])
        assert (found["status"]["running"], found["status"]["servo_on"]) == (True, True)
        assert (found["status"]["cmd_remote"], found["status"]["alarming"]) == (True, False)
        assert found["job"]["job_name"] == "DEMO"
        assert [*found["axes"].values()][:7] == [*"SLURBT", ""]
        assert found["alarm"]["code"] == found["past"]["code"] == 0
        assert found["position"]["data_type"] == 0
        degrees = [each / 1000 for each in found["position"]["pos"][:6]]
        assert not violations(PUMA, [each * 3.141592653589793 / 180 for each in degrees])
        assert found["system"]["model"].startswith("PUMA560")
        assert len(found["torque"]) == 7

    run(main())


@pytest.mark.skipif(
    not CLIENT, reason="MOTO_HSES_EXAMPLES does not name a folder with moto-hses-client's examples"
)
def test_moto_hses_client_reads_the_simulated_controller():
    async def main():
        async with simulator(demo=True, faults=("fault",)) as port:
            read = {
                name: await output_of(f"{CLIENT}/{name}", "127.0.0.1", str(port))
                for name in ("read_status", "position_operations", "alarm_operations")
            }
        assert "4107" in read["alarm_operations"]
        assert "OUT OF RANGE" in read["alarm_operations"]
        for text in (read["read_status"], read["position_operations"]):
            assert "Failed" not in text

    run(main())


@pytest.mark.skipif(not MOCK, reason="MOTO_HSES_MOCK does not name moto-hses-mock's program")
def test_moto_hses_mock_is_read():
    async def main():
        port, events = free_port(), []
        mock = await asyncio.create_subprocess_exec(MOCK, "127.0.0.1", str(port), str(free_port()))
        driver = HsesDriver(PUMA.types, {}, options=with_factors(YaskawaSettings(), 6))
        link = ControllerLink(
            LinkSettings(host="127.0.0.1", port=port), driver, on_event=lambda event, _: events.append(event)
        )
        task = asyncio.create_task(link.run())
        try:
            await until(lambda: sum(isinstance(each, JointsReceived) for each in events) > 40)
        finally:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task
            mock.terminate()
            await mock.wait()
        assert {each.positions for each in events if isinstance(each, JointsReceived)} == {(0.0,) * 6}
        assert any(isinstance(each, StatusReceived) for each in events)
        found = {
            signal.name: value
            for event in events
            if isinstance(event, SignalsReceived)
            for signal, value in event.values
        }
        assert (found["program.name"], found["program.line"], found["io.digital_in.1"]) == (
            "TEST.JOB",
            2,
            True,
        )
        # Its names of axes are of eight bytes instead of four.
        malformed = [each.reason for each in events if isinstance(each, MalformedReceived)]
        assert malformed in ([], ["names of axes with 56 bytes; 24, 28 and 32 are right"])

    run(main())
