"""Simulated controller of FANUC's kind over real sockets."""

import asyncio
import contextlib
import struct
import time

import numpy as np
import pytest

from controllers.fanuc import data as values
from controllers.fanuc import signals
from controllers.fanuc.axes import Axes, FanucSettings
from controllers.fanuc.signals import Operator
from controllers.fanuc.simulated.controller import SnpxController
from controllers.fanuc.simulated.service import SnpxSettings, serve_snpx
from controllers.fanuc.srtp import PORT, Area, BeginSession, Clear, Connect, Read, Service
from controllers.simulated.errors import FaultError, SimulatorError
from robomesh.errors import ListenError
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of
from robots.kinematics.model import build_model, link_placements
from robots.kinematics.verification import Sample, verify
from robots.schema.poses import axis_rotation
from tests.controllers.simulated_site import running

pytestmark = pytest.mark.slow

PUMA = load("puma560")
OPERATOR = Read(Area.ROBOT_OUTPUTS, 6000, 24)


@contextlib.asynccontextmanager
async def simulator(**options):
    async with running(serve_snpx, SnpxSettings(**options)) as ports:
        yield ports.snpx


class Client:
    """A client; its packets are numbered from 1."""

    def __init__(self, reader, writer):
        self.reader, self.writer = reader, writer
        self.number = 0

    async def packet(self):
        head = await self.reader.readexactly(56)
        return head + await self.reader.readexactly(int.from_bytes(head[4:6], "little"))

    async def exchange(self, data):
        """Return the answer to a packet."""
        self.writer.write(data)
        async with asyncio.timeout(20):
            return await self.packet()

    async def ask(self, question):
        """Return the data of an answer; None: the question is refused."""
        self.number = self.number % 254 + 1
        answer = await self.exchange(question.encode(self.number))
        if answer[0] == 1:
            return b""
        assert (answer[0], answer[2], answer[30]) == (3, self.number, self.number)
        if answer[31] == 0xD1:
            return None
        size = question.size if isinstance(question, Read) else 0
        return answer[56:] if answer[31] == 0x94 else answer[44 : 44 + size]

    async def write(self, area, text, first=0):
        """Write a text or data to an area; return the type of the answer."""
        data = bytearray(Clear().encode(9)[:56])
        data[4] = data[42] = data[54] = len(text)
        data[51:54] = struct.pack("<BH", area, first)
        return (await self.exchange(bytes(data) + text))[31]

    async def assign(self, text):
        return await self.write(0x38, text.encode()) == 0xD4

    async def words(self, first, count):
        return await self.ask(Read(Area.WORDS, first - 1, count))

    async def operator(self):
        return int.from_bytes(await self.ask(OPERATOR), "little")

    async def until(self, wanted, within_s=20.0):
        async with asyncio.timeout(within_s):
            while not wanted(found := await self.operator()):
                await asyncio.sleep(0.01)
        return found


@contextlib.asynccontextmanager
async def client(port):
    found = Client(*await asyncio.open_connection("127.0.0.1", port))
    try:
        assert await found.ask(Connect()) == b""
        assert await found.ask(BeginSession()) == b""
        yield found
    finally:
        found.writer.close()


async def test_a_new_connection_has_the_delivered_table_until_it_begins_its_own():
    async with simulator() as port, client(port) as one, client(port) as other:
        # R[1] is 12.5, as an integer of 16 bits; as another program assigns it.
        assert await one.words(1, 2) == struct.pack("<2h", 12, 0)
        assert await one.ask(Clear()) == b""
        assert await one.words(1, 2) == bytes(4)
        assert await other.words(1, 1) == struct.pack("<h", 12)
        assert await one.assign("SETASG 1 2 R[1] 0")
        assert await one.words(1, 2) == struct.pack("<f", 12.5)
        assert await one.assign("SETASG 11 4 R[1] 100")
        assert await one.words(11, 4) == struct.pack("<2i", 1250, 0)
        # Of two assignments of a word the earlier one counts, and an answer may begin within a value.
        assert await one.assign("SETASG 2 4 $MCR.$GENOVERRIDE 1")
        assert await one.words(2, 2) == struct.pack("<f", 12.5)[2:] + b"\0\0"


async def test_one_table_for_all_is_cleared_by_any_client():
    async with simulator(shared=True) as port, client(port) as one, client(port) as other:
        assert await one.words(1, 1) == struct.pack("<h", 12)
        assert await other.ask(Clear()) == b""
        assert await one.words(1, 1) == bytes(2)
        assert await other.assign("SETASG 1 2 R[1] 0")
        assert await one.words(1, 2) == struct.pack("<f", 12.5)


async def test_positions_alarms_and_parts_of_values_are_assigned():
    async with simulator(faults=("fault",)) as port, client(port) as one:
        for text in (
            "SETASG 10001 50 POS[G1:0] 0.0",
            "SETASG 10051 200 ALM[1] 1",
            "SETASG 10251 12 POS[0]@27.12 0",
            "SETASG 10263 26 $MNUTOOL[1,1]@1.26 0",
            "SETASG 10289 100 ALM[E1] 1",
            "SETASG 10389 18 PRG[2] 1",
            "SETASG 10407 26 $MNUTOOL[1,2]@1.26 0",
        ):
            assert await one.assign(text), text
        position = values.position(await one.words(10_001, 50))
        assert position.cartesian.configuration == "N R U T, 0, 0, 0"
        degrees = struct.unpack("<6f", await one.words(10_251, 12))
        assert position.axes[:6] == degrees
        home = [float(each) * 57.29577951308232 for each in joints_of(PUMA).home]
        assert [*degrees] == pytest.approx([*home[:2], home[2] - home[1], *home[3:]], abs=1e-4)
        (alarm,) = values.alarms(await one.words(10_051, 200))
        assert (alarm.number, alarm.severity_name) == ("SRVO-001", "SERVO")
        assert values.cartesian(await one.words(10_263, 26)) is not None
        assert values.alarms(await one.words(10_289, 100)) == []
        assert await one.words(10_389, 18) == bytes(36)
        assert values.cartesian(await one.words(10_407, 26)) is None


async def test_nothing_can_be_written_but_assignments():
    async with simulator() as port, client(port) as one:
        for area in (0x08, 0x0A, 0x0C, 0x46, 0x48, 0x4C, 0x10):
            assert await one.write(area, b"\1\0") == 0xD1
        for text in (
            "SETVAR $MCR.$GENOVERRIDE 10",
            "CLRALM",
            "SETASG 1 2",
            "SETASG 0 2 R[1] 0",
            "SETASG 16384 2 R[1] 0",
            "SETASG 1 2 $RMT_MASTER 1",
            "SETASG 1 50 POS[G2:0] 0",
            "SETASG 1 2 R[1]@2.5 0",
        ):
            assert not await one.assign(text), text
        for _ in range(79):
            assert await one.assign("SETASG 12000 2 R[1] 0")
        assert not await one.assign("SETASG 12000 2 R[1] 0")
        assert await one.ask(Read(Area.WORDS, 16_383, 2)) is None


async def test_a_fault_stops_the_arm_and_the_pendant_can_be_on():
    async with simulator(demo=True, faults=("fault@0.5+1", "local@2")) as port, client(port) as one:
        first = await one.operator()
        assert first >> Operator.PROGRAM_RUNNING & 1
        assert first >> Operator.COMMANDS_ENABLED & 1
        stopped = await one.until(lambda found: found >> Operator.FAULT & 1)
        assert not stopped >> Operator.SYSTEM_READY & 1
        await one.until(lambda found: found >> Operator.PROGRAM_RUNNING & 1)
        local = await one.until(lambda found: found >> Operator.PENDANT_ENABLED & 1)
        assert not local >> Operator.COMMANDS_ENABLED & 1


async def test_faults_of_the_answers_are_seen():
    async with simulator(faults=("mute",)) as port, client(port) as one:
        assert await one.ask(OPERATOR) is None
        assert await one.ask(Read(Area.ROBOT_INPUTS, 0, 8)) == b"\0"
    async with simulator(faults=("busy",)) as port, client(port) as one:
        answers = [await one.exchange(OPERATOR.encode(7)) for _ in range(4)]
        assert {each[31:32] + each[42:44] for each in answers} == {b"\xd1\7\0", b"\xd4\0\0"}
    async with simulator(faults=("flood",)) as port, client(port) as one:
        one.writer.write(OPERATOR.encode(7))
        assert len({await one.packet() for _ in range(50)}) == 1
    async with simulator(faults=("burst",)) as port, client(port) as one:
        begin_s = time.monotonic()
        await one.ask(OPERATOR)
        assert time.monotonic() - begin_s > 1.5
    async with simulator(faults=("split", "joints", "jump")) as port, client(port) as one:
        assert await one.assign("SETASG 10001 50 POS[G1:0] 0")
        assert values.position(await one.words(10_001, 50)).axes[6] > 10


async def test_a_fifth_client_and_bytes_that_are_no_packet_are_refused():
    async with simulator() as port, contextlib.AsyncExitStack() as stack:
        for _ in range(4):
            one = await stack.enter_async_context(client(port))
        with pytest.raises((ConnectionError, asyncio.IncompleteReadError)):
            async with client(port):
                pass
        one.writer.write(b"\x16\3\1" + bytes(60))
        assert await one.reader.read() == b""
        async with asyncio.timeout(20):
            while True:
                with contextlib.suppress(ConnectionError, asyncio.IncompleteReadError):
                    async with client(port):
                        break


async def test_a_refusing_and_a_restarting_controller_close_their_connections():
    for fault in ("refuse", "restart", "drop"):
        async with simulator(demo=True, faults=(f"{fault}@0.2+0.5",)) as port, client(port) as one:
            with contextlib.suppress(ConnectionError):
                assert await one.reader.read() == b""
            async with asyncio.timeout(20):
                while True:
                    with contextlib.suppress(ConnectionError, asyncio.IncompleteReadError):
                        async with client(port) as later:
                            found = await later.operator()
                            break
            running = bool(found >> Operator.PROGRAM_RUNNING & 1)
            assert running is (fault != "restart")


def sample(controller, j23):
    """Return what `robomesh robot verify` gets from the driver at the controller's position."""
    description = controller.position(0.0), controller.tool()
    position = values.position(description[0])
    positions = Axes(FanucSettings(j23=j23), joints_of(PUMA).types).positions(position.axes)
    frames = []
    for frame in (position.cartesian, values.cartesian(description[1][:52])):
        found = [value for _, value in signals.of_pose(frame).values][:6]
        placement = np.eye(4)
        vector = np.array(found[3:])
        placement[:3, :3] = axis_rotation(vector, float(np.linalg.norm(vector)))
        placement[:3, 3] = found[:3]
        frames.append(placement)
    pose, tool = frames
    return Sample(positions=np.array(positions), tool_to_base=pose, tool_to_flange=tool)


@pytest.mark.parametrize("j23", [1, -1])
def test_a_wrong_relation_of_axis_3_is_found_and_named_by_a_comparison(j23):
    joints, model = joints_of(PUMA), build_model(PUMA)
    axes = Axes(FanucSettings(j23=j23), joints.types)
    reach = np.random.default_rng(7).uniform(-0.5, 0.5, (10, 6))
    controllers = []
    for pose in joints.home + reach:
        arm = SnpxController(PUMA, axes, group=1, tour=None)
        arm.positions = lambda now_s, pose=pose: pose
        controllers.append(arm)

    def flange(positions):
        return link_placements(model, positions)[-1]

    right = verify(flange, joints, [sample(each, j23) for each in controllers])
    assert right.agrees
    assert max(each.distance_m for each in right.deviations) < 1e-6
    wrong = verify(flange, joints, [sample(each, 0) for each in controllers])
    assert not wrong.agrees
    sign = "plus" if j23 == 1 else "minus"
    assert wrong.suspects == (f"elbow is its value {sign} that of shoulder",)


async def test_settings_that_cannot_be_used_are_refused():
    for options, error, text in (
        ({"fanuc": FanucSettings(zero=(1.0,))}, SimulatorError, "has 1 values"),
        ({"fanuc": FanucSettings(assignments="pendant", group=9)}, SimulatorError, "group 9"),
        ({"faults": ("deaf",)}, FaultError, "deaf"),
        ({"listen": "192.0.2.1:1"}, ListenError, "no TLS|cannot listen"),
    ):
        with pytest.raises(error, match=text):
            async with simulator(**options):
                pass


def test_the_robot_interface_has_port_60008():
    assert PORT == 60008
    assert {*Service} == {4, 7, 0x4F}
