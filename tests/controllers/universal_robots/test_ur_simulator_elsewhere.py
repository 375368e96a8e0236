"""The simulated controller with ur_rtde, a client of others; skipped without `pip install ur-rtde`."""

import asyncio
import contextlib
import importlib.util
import json
import sys

import pytest

from controllers.universal_robots.driver import RTDE, RtdeDriver
from controllers.universal_robots.simulated.service import UrSettings, serve_rtde
from protocol_gateway.seam import Report, Send, SignalsReceived
from robots.descriptions.description import load
from robots.kinematics.joints import JointType, joints_of, violations
from tests.controllers.simulated_site import running

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(importlib.util.find_spec("rtde_receive") is None, reason="ur_rtde is not installed"),
]

# ur_rtde knows only port 30004, so each simulator has its own address of loopback.
READ = """
import json, sys, time
from rtde_receive import RTDEReceiveInterface
receive = RTDEReceiveInterface(sys.argv[1], 50.0)
first = receive.getTimestamp()
while receive.getTimestamp() < first + 0.2:
    time.sleep(0.01)
print(json.dumps({name: getattr(receive, "get" + name)() for name in sys.argv[2:]}))
receive.disconnect()
"""
WRITE = """
import json, sys, time
from rtde_io import RTDEIOInterface
from rtde_receive import RTDEReceiveInterface
receive = RTDEReceiveInterface(sys.argv[1])
io = RTDEIOInterface(sys.argv[1])
io.setStandardDigitalOut(3, True)
io.setSpeedSlider(0.5)
while not (receive.getDigitalOutState(3) and receive.getTargetSpeedFraction() == 0.5):
    time.sleep(0.01)
try:
    RTDEIOInterface(sys.argv[1])
    print(json.dumps("the second client took the inputs"))
except RuntimeError as error:
    print(json.dumps(str(error)))
"""


MOVE = """
import json, sys, time
from rtde_control import RTDEControlInterface
from rtde_receive import RTDEReceiveInterface
control = RTDEControlInterface(sys.argv[1])
receive = RTDEReceiveInterface(sys.argv[1])
start = receive.getActualQ()
target = [start[0] + 0.3, *start[1:4], start[4] - 0.2, start[5]]
control.moveJ(target, 0.8, 1.5)
there = receive.getActualQ()
control.moveJ([target[0] + 1.0, *target[1:]], 0.5, 1.5, True)
while receive.getActualQ()[0] < target[0] + 0.2:
    time.sleep(0.01)
control.stopJ(3.0)
stopped = receive.getActualQ()
control.setWatchdog(10.0)
while receive.getRuntimeState() != 1:
    time.sleep(0.01)
print(json.dumps([target, there, stopped]))
"""

LINE = """
import json, sys, time
from rtde_control import RTDEControlInterface
from rtde_receive import RTDEReceiveInterface
control = RTDEControlInterface(sys.argv[1])
receive = RTDEReceiveInterface(sys.argv[1])
begin = receive.getActualTCPPose()
target = [begin[0] - 0.05, begin[1] + 0.1, *begin[2:]]
control.moveL(target, 0.2, 1.0, True)
on_line = []
while not on_line or on_line[-1][1] < target[1] - 1e-6:
    on_line.append(receive.getActualTCPPose())
    time.sleep(0.01)
there = receive.getActualTCPPose()
control.moveL(begin, 0.2, 1.0, True)
while receive.getActualTCPPose()[1] > target[1] - 0.02:
    time.sleep(0.01)
control.stopL(2.0)
stopped = receive.getActualTCPPose()
refused = control.moveL([3.0, *begin[1:]], 0.2, 1.0)
control.reuploadScript()
while not control.isProgramRunning():
    time.sleep(0.01)
speed = receive.getActualTCPSpeed()
while abs(speed[2] + 0.1) > 1e-3:
    control.speedL([0.0, 0.0, -0.1, 0.0, 0.0, 0.0], 1.0)
    time.sleep(0.01)
    speed = receive.getActualTCPSpeed()
control.speedStop()
joints = receive.getActualQ()
joints[0] += 0.1
reached = receive.getActualQ()
while max(abs(a - b) for a, b in zip(reached, joints)) > 1e-3:
    control.servoJ(joints, 0.0, 0.0, 0.01, 0.1, 300)
    time.sleep(0.01)
    reached = receive.getActualQ()
control.servoStop()
print(json.dumps([begin, target, on_line, there, stopped, refused, speed, joints, reached]))
"""

RECOVER = """
import json, sys, time
from dashboard_client import DashboardClient
client = DashboardClient(sys.argv[1])
client.connect()
said = [client.isInRemoteControl(), client.safetystatus(), client.robotmode()]
try:
    client.unlockProtectiveStop()
    said.append("unlocked")
except RuntimeError as error:
    said.append(str(error))
began = time.monotonic()
while time.monotonic() < began + 5.5:
    time.sleep(0.1)
client.closeSafetyPopup()
client.unlockProtectiveStop()
said += [client.safetystatus(), client.programState()]
client.stop()
client.restartSafety()
said.append(client.robotmode())
client.powerOn()
while "IDLE" not in client.robotmode():
    time.sleep(0.05)
client.brakeRelease()
while "RUNNING" not in client.robotmode():
    time.sleep(0.05)
said += [client.robotmode(), client.running()]
print(json.dumps(said))
"""


async def client_of(address, program, *words):
    """Return the last line that a program prints, read as JSON."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-c", program, address, *words), stdout=asyncio.subprocess.PIPE
    )
    output, _ = await process.communicate()
    assert process.returncode == 0
    return json.loads(output.splitlines()[-1])


async def signals_of(address, port):
    """Return the signals that the gateway's driver reports first, by name; a joint's by its number."""
    driver = RtdeDriver((JointType.ROTARY,) * 6, {})
    reader, writer = await asyncio.open_connection(address, port)
    try:
        effects = driver.opened(RTDE, 0.0)
        while True:
            for effect in effects:
                if isinstance(effect, Send):
                    writer.write(effect.data)
                for event in effect.events if isinstance(effect, Report) else ():
                    if isinstance(event, SignalsReceived):
                        return {
                            signal.name
                            if signal.joint is None
                            else signal.name.replace(".", f".{signal.joint}.", 1): value
                            for signal, value in event.values
                        }
            effects = driver.received(RTDE, await reader.read(4096), 0.0)
    finally:
        writer.close()


@contextlib.asynccontextmanager
async def simulator(address, *, demo=True, faults=()):
    settings = UrSettings(
        listen=f"{address}:30004",
        primary=f"{address}:0",
        scripts=(f"{address}:30003",),  # where ur_rtde sends its program
        dashboard=f"{address}:29999",
        demo=demo,
        faults=faults,
    )
    async with running(serve_rtde, settings) as ports:
        yield ports[:2]


async def test_ur_rtde_reads_states():
    async with simulator("127.0.31.1"):
        names = ("ActualQ", "ActualQd", "RobotMode", "SafetyMode", "RuntimeState", "RobotStatus")
        names += ("SafetyStatusBits", "JointMode", "ActualTCPPose", "Payload", "JointTemperatures")
        read = await client_of("127.0.31.1", READ, *names)
    assert not violations(joints_of(load("puma560")), read["ActualQ"])
    assert (read["RobotMode"], read["SafetyMode"], read["RuntimeState"]) == (7, 1, 2)
    assert (read["RobotStatus"], read["SafetyStatusBits"], read["JointMode"]) == (3, 1, [253] * 6)
    assert len(read["ActualTCPPose"]) == 6
    assert read["Payload"] == 1.2
    assert all(24.0 <= each < 36.0 for each in read["JointTemperatures"])


async def test_ur_rtde_and_the_gateway_s_driver_read_the_same_signals():
    # What changes between two reads is compared by its range only.
    names = ("TargetMoment", "ActualCurrent", "JointTemperatures", "Payload", "PayloadCog", "ActualTCPForce")
    names += ("SpeedScaling", "TargetSpeedFraction", "RobotMode", "SafetyMode", "RuntimeState")
    names += ("StandardAnalogInput0", "StandardAnalogInput1", "StandardAnalogOutput0")
    names += ("ActualRobotVoltage", "ActualDigitalOutputBits", "ActualDigitalInputBits")
    async with simulator("127.0.31.3") as (rtde, _):
        theirs = await client_of("127.0.31.3", READ, *names)
        ours = await signals_of("127.0.31.3", rtde)
    assert ours["payload.mass"] == theirs["Payload"] == 1.2
    assert [ours[f"payload.{axis}"] for axis in "xyz"] == theirs["PayloadCog"]
    assert [ours[f"tool.force.{axis}"] for axis in "xyz"] == theirs["ActualTCPForce"][:3]
    assert ours["speed.scaling"] == 100 * theirs["SpeedScaling"]
    assert ours["speed.override"] == 100 * theirs["TargetSpeedFraction"]
    modes = [ours[name] for name in ("robot.mode", "safety.mode", "program.state")]
    assert modes == ["running", "normal", "playing"]
    assert [theirs[name] for name in ("RobotMode", "SafetyMode", "RuntimeState")] == [7, 1, 2]
    assert ours["io.analog_in.0"] == theirs["StandardAnalogInput0"] == 2.5
    assert ours["io.analog_in.1"] == theirs["StandardAnalogInput1"] == 0.012
    assert ours["robot.voltage"] == theirs["ActualRobotVoltage"] == 48.0
    assert theirs["ActualDigitalOutputBits"] == 0
    assert not any(value for name, value in ours.items() if name.startswith("io.digital_out."))
    for joint in range(6):
        assert ours[f"joint.{joint}.temperature"] == pytest.approx(theirs["JointTemperatures"][joint], abs=1)
        # What holds the arm is proportional to the motor's current, in both readers.
        for moment, current in (
            (ours[f"joint.{joint}.target_torque"], ours[f"joint.{joint}.current"]),
            (theirs["TargetMoment"][joint], theirs["ActualCurrent"][joint]),
        ):
            assert 9.0 * abs(current) - 1e-9 <= abs(moment) <= 12.0 * abs(current) + 1e-9


async def test_ur_rtde_writes_outputs_and_a_second_one_finds_them_in_use():
    async with simulator("127.0.31.2"):
        assert "already in use" in await client_of("127.0.31.2", WRITE)


async def test_program_of_ur_rtde_moves_and_stops_the_arm_and_its_watchdog_ends_it():
    async with simulator("127.0.31.5", demo=False):
        target, there, stopped = await client_of("127.0.31.5", MOVE)
    assert there == pytest.approx(target, abs=1e-9)
    assert 0.2 <= stopped[0] - target[0] < 0.9
    assert stopped[1:] == pytest.approx(target[1:], abs=1e-9)


async def test_ur_rtde_moves_the_tool_on_a_line_at_a_speed_and_by_targets():
    async with simulator("127.0.31.7", demo=False):
        begin, target, on_line, there, stopped, refused, speed, joints, reached = await client_of(
            "127.0.31.7", LINE
        )
    assert there == pytest.approx(target, abs=1e-6)
    for x, y, *others in (*on_line, stopped):
        assert [y, *others] == pytest.approx([begin[1] - 2 * (x - begin[0]), *begin[2:]], abs=1e-5)
    assert begin[1] < stopped[1] < target[1]
    assert not refused
    assert speed == pytest.approx([0, 0, -0.1, 0, 0, 0], abs=1e-3)
    assert reached == pytest.approx(joints, abs=1e-3)


async def test_dashboard_client_of_ur_rtde_recovers_the_arm():
    async with simulator("127.0.31.6", faults=("fault@0+600",)):
        remote, safety, mode, young, unlocked, program, restarted, running, plays = await client_of(
            "127.0.31.6", RECOVER
        )
    assert remote
    assert ("PROTECTIVE_STOP" in safety, "RUNNING" in mode) == (True, True)
    assert "5s after occurrence" in young
    assert ("NORMAL" in unlocked, "PAUSED" in program) == (True, True)
    assert ("POWER_OFF" in restarted, "RUNNING" in running, plays) == (True, True, False)
