"""HSES with programs of others; each test is skipped without its program (CONTRIBUTING.md)."""

import asyncio
import contextlib
import importlib.util
import json
import os
import sys

import pytest

from controllers.yaskawa import commands
from controllers.yaskawa.axes import YaskawaSettings, with_factors
from controllers.yaskawa.driver import HsesDriver
from controllers.yaskawa.hses import decode
from protocol_gateway.link.link import ControllerLink, LinkSettings
from protocol_gateway.seam import JointsReceived, MalformedReceived, SignalsReceived, StatusReceived
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of, violations
from tests.conftest import run
from tests.controllers.yaskawa.test_hses_simulator import simulator
from tests.ports import free_port
from tests.protocol_gateway.gateway_site import until
from tests.protocol_gateway.scripted_controller import endless_joints

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
if found["status"]["running"]:
    now = tuple(found["position"]["pos"])
    assert robot.pmov(1, 0, 5000, now) != 0
    assert robot.errno == 0x2010
    assert robot.switch_power(FS100.POWER_TYPE_HOLD, FS100.POWER_SWITCH_ON) == 0
    held = {}
    assert robot.get_status(held) == 0
    assert (held["hold_by_cmd"], held["running"]) == (True, False)
    assert robot.pmov(1, 0, 5000, now) != 0
    assert robot.errno == 0x2050
    assert robot.switch_power(FS100.POWER_TYPE_HOLD, FS100.POWER_SWITCH_OFF) == 0
    # Until it has braked.
    while robot.pmov(1, 0, 5000, now) != 0:
        assert robot.errno == 0x2010
print(json.dumps(found))
"""


MOVE = """
import json, sys, time
from yrcom.hses_client import HsesClient, HsesError, PulseMove
robot = HsesClient("127.0.0.1", int(sys.argv[1]), 5.0)
robot.open()

def refused(action):
    # This client reads the number of words of the added status as the status: 1 for any refusal.
    try:
        action()
    except HsesError as error:
        assert error.status == 1
    else:
        raise AssertionError("not refused")

def until(condition):
    end = time.monotonic() + 30
    while not condition(robot.read_status()):
        assert time.monotonic() < end
        time.sleep(0.02)

target = [30000, -80000, 170000, 10000, 40000, 5000]
robot.move_pulse(PulseMove(robot_axes=target, speed=5000))
until(lambda status: status["running"])
refused(lambda: robot.move_pulse(PulseMove(robot_axes=target, speed=5000)))
robot.hold(True)
until(lambda status: status["hold_cmd"] and not status["running"])
refused(lambda: robot.move_pulse(PulseMove(robot_axes=target, speed=5000)))
robot.hold(False)
until(lambda status: not status["hold_cmd"] and not status["running"])
robot.move_pulse(PulseMove(robot_axes=target, speed=10000))
until(lambda status: not status["running"])
print(json.dumps(robot.read_position(1)))
refused(lambda: robot.move_pulse(PulseMove(robot_axes=target, speed=20000)))
refused(lambda: robot.move_pulse(PulseMove(robot_axes=target, speed=100, base_axes=[1, 0, 0])))
robot.servo(False)
until(lambda status: not status["servo_on"])
refused(lambda: robot.move_pulse(PulseMove(robot_axes=target, speed=5000)))
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
async def test_fs100_reads_the_simulated_controller():
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


@pytest.mark.skipif(importlib.util.find_spec("yrcom") is None, reason="yrcom is not installed")
async def test_yrcom_moves_and_holds_the_simulated_controller():
    async with simulator() as port:
        lines = (await output_of(sys.executable, "-c", MOVE, str(port))).splitlines()
        found = json.loads(next(each for each in lines if each.startswith("{")))
    assert {30000, -80000, 170000, 10000, 40000, 5000} <= {*found.values()}


@pytest.mark.skipif(
    not CLIENT, reason="MOTO_HSES_EXAMPLES does not name a folder with moto-hses-client's examples"
)
async def test_moto_hses_client_reads_the_simulated_controller():
    async with simulator(demo=True, faults=("fault",)) as port:
        read = {
            name: await output_of(f"{CLIENT}/{name}", "127.0.0.1", str(port))
            for name in ("read_status", "position_operations", "alarm_operations")
        }
        held = await output_of(f"{CLIENT}/hold_servo_control", "127.0.0.1", str(port))
    # As published the example switches the servos; with COMMAND_NAME = "hold" it sets and ends HOLD.
    assert "to ON" in held
    assert "Failed" not in held
    assert "4107" in read["alarm_operations"]
    assert "OUT OF RANGE" in read["alarm_operations"]
    for text in (read["read_status"], read["position_operations"]):
        assert "Failed" not in text


@pytest.mark.skipif(not MOCK, reason="MOTO_HSES_MOCK does not name moto-hses-mock's program")
async def test_moto_hses_mock_is_read():
    port, events = free_port(), []
    mock = await asyncio.create_subprocess_exec(MOCK, "127.0.0.1", str(port), str(free_port()))
    driver = HsesDriver(PUMA.types, {}, options=with_factors(YaskawaSettings(), 6))
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
    # Its names of axes are of eight bytes instead of four, and it answers the tool's pose in pulses.
    malformed = {each.reason for each in events if isinstance(each, MalformedReceived)}
    assert all("with 56 bytes" in each or "a tool's pose of type 0" in each for each in malformed)


@pytest.mark.skipif(not MOCK, reason="MOTO_HSES_MOCK does not name moto-hses-mock's program")
def test_moto_hses_mock_takes_hold_and_motions_as_they_are_sent():
    """Framing only: it moves nothing."""

    async def main():
        port = free_port()
        mock = await asyncio.create_subprocess_exec(MOCK, "127.0.0.1", str(port), str(free_port()))
        try:
            sent = (
                (commands.hold(128, on=True), 0x10),
                (commands.hold(129, on=False), 0x10),
                (commands.motion(7, robot=1, percent=5, pulses=(0,) * 8, tool=0), 0x02),
            )
            return [(await answered(port, datagram), datagram[11], service) for datagram, service in sent]
        finally:
            mock.terminate()
            await mock.wait()

    for answer, number, service in run(main()):
        assert (answer.number, answer.service, answer.status) == (number, service, 0)


async def answered(port, datagram):
    """Send a datagram until it is answered; return the answer."""
    loop = asyncio.get_running_loop()
    received = asyncio.Queue()

    class Client(asyncio.DatagramProtocol):
        def datagram_received(self, data, address):
            received.put_nowait(decode(data))

        def error_received(self, error):
            pass

    client, _ = await loop.create_datagram_endpoint(Client, remote_addr=("127.0.0.1", port))
    try:
        async with asyncio.timeout(20.0):
            while True:
                client.sendto(datagram)
                with contextlib.suppress(TimeoutError):
                    return await asyncio.wait_for(received.get(), 0.3)
    finally:
        client.close()
