"""Simulated controller of Universal Robots' kind over real sockets."""

import asyncio
import contextlib
import math
import re
import struct
import sys
import time
from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from controllers.simulated.errors import FaultError, SimulatorError
from controllers.simulated.fault_table import LEAP
from controllers.simulated.faults import Faults
from controllers.universal_robots.interfaces import rtde_messages as rtde
from controllers.universal_robots.interfaces.modes import (
    JointMode,
    ReportLevel,
    RobotMode,
    RobotStatus,
    RuntimeState,
    SafetyMode,
    SafetyStatus,
    TextLevel,
)
from controllers.universal_robots.interfaces.packages import Malformed
from controllers.universal_robots.interfaces.primary import (
    Alarm,
    KeyMessage,
    PrimaryStream,
    PrimaryVersion,
    SafetyModeChanged,
)
from controllers.universal_robots.interfaces.rtde_messages import (
    ControllerVersion,
    DataReceived,
    InputsSetUp,
    OutputsSetUp,
    PauseAnswered,
    ProtocolVersionAnswered,
    Recipe,
    RtdeStream,
    StartAnswered,
    TextReceived,
)
from controllers.universal_robots.interfaces.rtde_reader import Ready, RtdeReader
from controllers.universal_robots.interfaces.state import OUTPUTS, ControllerState
from controllers.universal_robots.simulated import service
from controllers.universal_robots.simulated.controller import UrController
from controllers.universal_robots.simulated.service import UrSettings, serve_rtde
from controllers.universal_robots.simulated.start import RTDE
from robomesh.errors import ListenError
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of
from robots.kinematics.model import build_model, tool_placement
from robots.schema.poses import rotation_vector
from tests.conftest import run
from tests.controllers.simulated_site import running

pytestmark = pytest.mark.slow

PUMA = load("puma560")


@contextlib.asynccontextmanager
async def simulator(**options):
    async with running(serve_rtde, UrSettings(**options)) as ports:
        yield ports[:2]


@contextlib.asynccontextmanager
async def connection(port):
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        yield reader, writer
    finally:
        writer.close()


async def read(reader):
    data = await reader.read(4096)
    if not data:
        raise EOFError
    return data


class Monitor:
    """A client that reads states with the gateway's reader."""

    def __init__(self, reader, writer, *, frequency_hz=125.0, fields=OUTPUTS):
        self.reader, self.writer = reader, writer
        self.rtde = RtdeReader(frequency_hz, fields)
        writer.write(self.rtde.connected())
        self.events = []

    async def next(self, wanted):
        """Return the next event that meets the predicate."""
        while True:
            while self.events:
                event = self.events.pop(0)
                if wanted(event):
                    return event
            self.events += self.rtde.receive(await read(self.reader))
            self.writer.write(self.rtde.to_send())

    async def state(self, wanted=lambda state: True):
        return await self.next(lambda e: isinstance(e, ControllerState) and wanted(e))

    async def ready(self):
        return await self.next(lambda e: isinstance(e, Ready))


class Client:
    """A client that sends requests one by one."""

    def __init__(self, reader, writer):
        self.reader, self.writer = reader, writer
        self.stream = RtdeStream()
        self.packages = []

    async def ask(self, data, kind):
        """Send a request; return the next message of a kind."""
        self.writer.write(data)
        while True:
            while self.packages:
                package = self.packages.pop(0)
                message = package if isinstance(package, Malformed) else self.stream.decode(package)
                if isinstance(message, kind):
                    return message
            self.packages += self.stream.receive(await read(self.reader))

    async def version(self, number):
        accepted = (await self.ask(rtde.request_protocol_version(number), ProtocolVersionAnswered)).accepted
        if accepted:
            self.stream.version = number
        return accepted

    async def outputs(self, names, frequency_hz):
        answer = await self.ask(rtde.set_up_outputs(names, frequency_hz), OutputsSetUp)
        if rtde.NOT_FOUND not in answer.types:
            self.stream.recipe = Recipe(names, answer.types, answer.recipe_id)
        return answer


async def test_gateways_reader_gets_all_fields_of_a_moving_arm():
    async with simulator(demo=True) as (port, _), connection(port) as streams:
        monitor = Monitor(*streams)
        assert await monitor.ready() == Ready(ControllerVersion(5, 21, 0, 0), 2, 125.0, ())
        first = await monitor.state()
        later = await monitor.state(lambda state: math.dist(state.positions, first.positions) > 0.1)
        assert None not in [getattr(later, name) for name in ControllerState.__slots__]
        assert later.timestamp_s > first.timestamp_s
        assert later.robot_mode == RobotMode.RUNNING
        assert later.safety_mode == SafetyMode.NORMAL
        assert later.runtime_state == RuntimeState.PLAYING
        assert later.robot_status == RobotStatus.POWER_ON | RobotStatus.PROGRAM_RUNNING
        assert later.safety_status == SafetyStatus.NORMAL_MODE
        assert later.joint_modes == (JointMode.RUNNING,) * 6
        assert later.script_line > 0
        placement = tool_placement(build_model(PUMA), later.positions)
        assert later.tool_pose[:3] == pytest.approx(placement[:3, 3].tolist(), abs=1e-9)


async def test_arm_without_a_program_rests_at_home():
    async with simulator() as (port, _), connection(port) as streams:
        state = await Monitor(*streams).state()
        assert state.positions == pytest.approx(joints_of(PUMA).home.tolist())
        assert state.velocities == (0.0,) * 6
        assert (state.runtime_state, state.script_line) == (RuntimeState.STOPPED, 0)
        assert state.robot_status == RobotStatus.POWER_ON


@pytest.mark.parametrize(("version", "highest_hz"), [((3, 15, 0, 0), 125.0), ((5, 21, 0, 0), 500.0)])
async def test_frequency_is_limited_as_on_the_controller(version, highest_hz):
    async with simulator(version=version) as (port, _), connection(port) as streams:
        monitor = Monitor(*streams, frequency_hz=1000.0)
        assert (await monitor.ready()).frequency_hz == highest_hz
        times = [(await monitor.state()).timestamp_s for _ in range(20)]
        # A busy machine sends less often, never more often on average.
        assert times[-1] - times[0] > 18 / highest_hz
        assert all(later > earlier for earlier, later in pairwise(times))


async def test_each_client_has_its_recipe_and_frequency():
    async with (
        simulator(demo=True) as (port, _),
        connection(port) as one,
        connection(port) as two,
    ):
        fast = Monitor(*one, fields={"timestamp": "DOUBLE", "actual_q": "VECTOR6D"})
        slow = Client(*two)
        assert await slow.version(2)
        assert (await slow.outputs(["timestamp", "robot_mode"], 5.0)).types == ("DOUBLE", "INT32")
        assert (await slow.ask(rtde.start(), StartAnswered)).accepted
        first = await slow.ask(b"", DataReceived)
        second = await slow.ask(b"", DataReceived)
        assert second.values["timestamp"] - first.values["timestamp"] > 0.15
        assert (await fast.state()).robot_mode is None


async def test_protocol_version_1_has_no_frequency_and_no_numbers():
    async with simulator() as (port, _), connection(port) as streams:
        client = Client(*streams)
        assert not await client.version(3)
        assert await client.version(1)
        assert (await client.outputs(["timestamp"], None)).recipe_id is None
        assert (await client.ask(rtde.start(), StartAnswered)).accepted
        assert (await client.ask(b"", DataReceived)).values["timestamp"] > 0


async def test_unknown_field_is_not_found_and_start_is_refused():
    async with simulator(version=(3, 15, 0, 0)) as (port, _), connection(port) as streams:
        client = Client(*streams)
        await client.version(2)
        answer = await client.outputs(["timestamp", "no_such_field", "ft_raw_wrench"], 10.0)
        assert answer.types == ("DOUBLE", "NOT_FOUND", "NOT_FOUND")
        assert not (await client.ask(rtde.start(), StartAnswered)).accepted


async def test_pause_and_start_again():
    async with simulator() as (port, _), connection(port) as streams:
        client = Client(*streams)
        await client.version(2)
        await client.outputs(["timestamp"], 500.0)
        assert (await client.ask(rtde.start(), StartAnswered)).accepted
        await client.ask(b"", DataReceived)
        assert (await client.ask(rtde.pause(), PauseAnswered)).accepted
        # Nothing follows the answer: the next package is the answer to the next request.
        client.writer.write(rtde.request_controller_version())
        (package,) = client.packages or client.stream.receive(await read(client.reader))
        assert isinstance(client.stream.decode(package), ControllerVersion)
        assert (await client.ask(rtde.start(), StartAnswered)).accepted
        await client.ask(b"", DataReceived)


async def test_input_belongs_to_its_first_client_until_it_disconnects():
    taken = frozenset({"input_int_register_0"})
    names = ["standard_digital_output_mask", "standard_digital_output", "speed_slider_mask"]
    names += ["speed_slider_fraction", "input_double_register_2"]
    async with simulator(taken=taken) as (port, _), connection(port) as two:
        second = Client(*two)
        async with connection(port) as one:
            first = Client(*one)
            await first.version(2)
            answer = await first.ask(rtde.set_up_inputs(names), InputsSetUp)
            assert answer == InputsSetUp(1, ("UINT8", "UINT8", "UINT32", "DOUBLE", "DOUBLE"))
            bus = await first.ask(rtde.set_up_inputs(["input_int_register_0", "nothing"]), InputsSetUp)
            assert bus.types == ("IN_USE", "NOT_FOUND")
            assert (await second.ask(rtde.set_up_inputs(names[:1]), InputsSetUp)).types == ("IN_USE",)
            await first.outputs(["actual_digital_output_bits", "target_speed_fraction", names[-1]], 100.0)
            await first.ask(rtde.start(), StartAnswered)
            values = struct.pack(">BBBIdd", 1, 0b101, 0b111, 1, 0.25, -3.5)
            first.writer.write(rtde.package(rtde.PackageType.DATA, values))
            written = {
                "actual_digital_output_bits": 0b101,
                "target_speed_fraction": 0.25,
                names[-1]: -3.5,
            }
            while (await first.ask(b"", DataReceived)).values != written:
                pass
        while (await second.ask(rtde.set_up_inputs(names[:1]), InputsSetUp)).types == ("IN_USE",):
            await asyncio.sleep(0.01)


@pytest.fixture
def schedules(monkeypatch):
    """The fault schedules of the simulators that the test starts."""
    made = []

    def make(*arguments, **options):
        made.append(Faults(*arguments, **options))
        return made[-1]

    monkeypatch.setattr(service, "Faults", make)
    return made


async def test_protective_stop_is_reported_on_both_interfaces(schedules):
    async with (
        simulator(demo=True) as (port, primary),
        connection(primary) as (reader, _),
        connection(port) as streams,
    ):
        stream, events = PrimaryStream(), []
        events += stream.receive(await read(reader))
        monitor = Monitor(*streams)
        await monitor.ready()
        schedules[0].begin("fault", time.monotonic())
        stopped = await monitor.state(lambda state: state.safety_mode == SafetyMode.PROTECTIVE_STOP)
        assert stopped.runtime_state == RuntimeState.PAUSED
        assert SafetyStatus.PROTECTIVE_STOPPED in stopped.safety_status
        schedules[0].end("fault")
        again = await monitor.state(lambda state: state.safety_mode == SafetyMode.NORMAL)
        assert again.runtime_state == RuntimeState.PLAYING
        while [type(each) for each in events].count(SafetyModeChanged) < 2 or not stream.skipped:
            events += stream.receive(await read(reader))
        version, alarm, begin, end = events
        assert isinstance(version, PrimaryVersion)
        assert (version.name, version.major, version.minor) == ("URControl", 5, 21)
        assert isinstance(alarm, Alarm)
        assert (alarm.name, alarm.level) == ("C153A0", ReportLevel.VIOLATION)
        assert [begin.mode, end.mode] == [SafetyMode.PROTECTIVE_STOP, SafetyMode.NORMAL]


async def test_restart_begins_without_power_and_with_a_new_time(schedules):
    async with simulator(demo=True) as (port, _):
        async with connection(port) as streams:
            monitor = Monitor(*streams)
            before = await monitor.state()
            schedules[0].begin("restart+0.2", time.monotonic())
            with pytest.raises((EOFError, ConnectionError)):
                await monitor.state(lambda state: False)
        while True:
            with contextlib.suppress(EOFError, ConnectionError):
                async with connection(port) as streams:
                    after = await Monitor(*streams).state()
                    break
            await asyncio.sleep(0.05)
        assert before.robot_mode == RobotMode.RUNNING
        assert after.robot_mode == RobotMode.POWER_OFF
        assert after.joint_modes == (JointMode.POWER_OFF,) * 6
        assert after.robot_status == RobotStatus(0)
        assert (after.runtime_state, after.currents_a) == (RuntimeState.STOPPED, (0.0,) * 6)


@pytest.mark.parametrize("fault", ["garbage", "split", "flood", "burst", "jump"])
async def test_reader_survives_a_fault(fault):
    async with simulator(demo=True, faults=(f"{fault}@0.2",)) as (port, _), connection(port) as streams:
        monitor = Monitor(*streams)
        match fault:
            case "garbage":
                malformed = [await monitor.next(lambda e: isinstance(e, Malformed)) for _ in range(8)]
                assert len({event.reason for event in malformed}) == 4
                assert not any(event.fatal for event in malformed)
            case "flood":
                counts = Counter()
                while max(counts.values(), default=0) < 50:
                    counts[(await monitor.state()).timestamp_s] += 1
            case "jump":
                half = math.radians(LEAP) / 2
                await monitor.state(lambda s: abs(s.positions[0] - s.target_positions[0]) > half)
            case "split":
                start_s = (await monitor.state()).timestamp_s
                await monitor.state(lambda s: s.timestamp_s > start_s + 1.0)
            case "burst":
                # States keep their own times, so some arrive more than a second late.
                last_s = (await monitor.state()).timestamp_s
                gaps = []
                while max(gaps, default=0.0) < 1.0:
                    began_s = asyncio.get_running_loop().time()
                    last_s = (await monitor.state(lambda s, after=last_s: s.timestamp_s >= after)).timestamp_s
                    gaps.append(asyncio.get_running_loop().time() - began_s)
        assert isinstance(await monitor.state(), ControllerState)


async def test_nonsense_is_answered_with_a_text_and_a_lost_stream_is_closed():
    async with simulator() as (port, _), connection(port) as streams:
        client = Client(*streams)
        await client.version(2)
        text = await client.ask(bytes.fromhex("0005 7a 0102"), TextReceived)
        assert (text.level, text.source) == (TextLevel.ERROR, "URControl")
        assert "type 122 with 2 bytes" in text.text
        assert "recipe" in (await client.ask(bytes.fromhex("0004 55 09"), TextReceived)).text
        many = await client.ask(rtde.package(rtde.PackageType.SET_UP_INPUTS, b"," * 1000), TextReceived)
        assert "1000 fields are too many" in many.text
        assert "frequency" in (await client.ask(bytes.fromhex("0004 4f 09"), TextReceived)).text
        await client.ask(rtde.request_controller_version(), ControllerVersion)
        with pytest.raises((EOFError, ConnectionError)):
            await client.ask(b"\xff\xff\xff", StartAnswered)


def test_invalid_settings_are_refused():
    async def main(**options):
        async with simulator(**options):
            pass

    with pytest.raises(SimulatorError, match="pt600 has 5 joints, this protocol needs 6 rotary ones"):
        run(main(robot="pt600"))
    with pytest.raises(FaultError, match="'mute' is unknown; there are freeze, garbage, split"):
        run(main(faults=("mute",)))
    with pytest.raises(SimulatorError, match="input field speed is unknown"):
        run(main(taken=frozenset({"speed"})))
    with pytest.raises(ListenError):
        run(main(listen="0.0.0.0:0"))


def test_program_announces_its_start():
    sent = []
    home = joints_of(PUMA).home
    UrController(PUMA, tour=iter([home]), powered=True, now_s=5.0, announce=sent.append)
    assert isinstance(sent[0], KeyMessage)
    assert (sent[0].title, sent[0].text) == ("PROGRAM_XXX_STARTED", "demo")


def test_rotation_vector_is_the_axis_times_the_angle():
    generator = np.random.default_rng(1)
    axes = generator.normal(size=(200, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    for axis, angle in zip(
        axes, [0.0, 1e-9, 1e-4, math.pi - 1e-7, math.pi, *generator.uniform(0, math.pi, 195)], strict=True
    ):
        x, y, z = axis
        cross = np.array(((0, -z, y), (z, 0, -x), (-y, x, 0)))
        rotation = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
        found = rotation_vector(rotation)
        # Half a turn has two axes.
        assert min(np.abs(found - axis * angle).max(), np.abs(found + axis * angle).max()) < 1e-7
        if angle < math.pi - 1e-3:
            assert found == pytest.approx(axis * angle, abs=1e-7)


@pytest.mark.parametrize(
    ("listen", "scripts", "others"),
    [
        ("", "127.0.0.1:30001 127.0.0.1:30002 127.0.0.1:30003", ["127.0.0.1:30011", "127.0.0.1:29999"]),
        ("[::1]:30004", "::1:30001 ::1:30002 ::1:30003", ["::1:30011", "::1:29999"]),
        ("10.0.0.7:4", "10.0.0.7:0 10.0.0.7:0 10.0.0.7:0", ["10.0.0.7:0", "10.0.0.7:0"]),
    ],
)
def test_other_interfaces_are_at_the_address_of_rtde_unless_their_own_is_given(
    monkeypatch, listen, scripts, others
):
    found = []
    monkeypatch.setattr(service, "serve_rtde", lambda settings, ready: found.append(settings))
    listen = listen or RTDE.listen
    common = {"robot": "", "listen": listen, "demo": False, "faults": (), "insecure": True, "mesh": None}
    for options in (
        {"primary": "", "scripts": [], "dashboard": ""},
        {"primary": "a:1", "scripts": ["b:2"], "dashboard": "c:3"},
    ):
        RTDE.prepare(common, **options)(print)
    one, other = ((" ".join(each.scripts), [each.primary, each.dashboard]) for each in found)
    assert one == (scripts, others)
    assert other == ("b:2", ["a:1", "c:3"])


async def test_command_serves_all_interfaces():
    words = ("simulate", "--protocol", "rtde", "--demo", "--listen", "127.0.0.1:0")
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "services.command_line.main", *words), stdout=asyncio.subprocess.PIPE
    )
    try:
        line = (await process.stdout.readline()).decode()
        ports = re.fullmatch(
            r"listening on \S+:(\d+), primary interface on \S+:(\d+), scripts on \S+:\d+, \d+, \d+, "
            r"dashboard on \S+:(\d+)\n",
            line,
        )
        async with connection(int(ports[1])) as streams, connection(int(ports[2])) as (reader, _):
            assert (await Monitor(*streams).ready()).controller.major == 5
            (version, *_) = PrimaryStream().receive(await read(reader))
            assert isinstance(version, PrimaryVersion)
        process.terminate()
        assert await process.wait() == 0
    finally:
        if process.returncode is None:
            process.kill()
