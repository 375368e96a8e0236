"""Simulated controller of Yaskawa's kind over real sockets."""

import asyncio
import contextlib
import time

import pytest

from controllers.simulated.errors import FaultError, SimulatorError
from controllers.yaskawa import data as payloads
from controllers.yaskawa.axes import YaskawaSettings
from controllers.yaskawa.data import DataType, Status1, Status2
from controllers.yaskawa.hses import PORT, Command, Read, Service, decode
from controllers.yaskawa.simulated.service import HsesSettings, serve_hses
from robomesh.errors import ListenError
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of, violations
from tests.controllers.simulated_site import running

pytestmark = pytest.mark.slow

PUMA = load("puma560")
POSITION, STATUS = Read(Command.POSITION, 1), Read(Command.STATUS, 1)


def simulator(**options):
    return running(serve_hses, HsesSettings(**options))


class Client(asyncio.DatagramProtocol):
    """A client that asks; answers are kept in the order of their receipt."""

    def __init__(self):
        self.received = asyncio.Queue()
        self.number = 0

    def connection_made(self, transport):
        self.transport = transport

    def datagram_received(self, data, address):
        self.received.put_nowait(data)

    def error_received(self, error):
        self.received.put_nowait(error)

    def send(self, read):
        self.number = (self.number + 1) % 256
        self.transport.sendto(read.encode(self.number))

    async def ask(self, read, within_s=60.0):
        """Return the answer to a question, which is repeated until it comes."""
        async with asyncio.timeout(within_s):
            while True:
                self.send(read)
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(0.5):
                        while True:
                            data = await self.received.get()
                            with contextlib.suppress(ValueError):
                                if isinstance(data, bytes) and decode(data).number == self.number:
                                    return decode(data)

    async def positions(self):
        return payloads.position((await self.ask(POSITION)).data)

    async def status(self):
        return payloads.status((await self.ask(STATUS)).data)

    async def until(self, asked, wanted, within_s=20.0):
        async with asyncio.timeout(within_s):
            while not wanted(found := await asked()):
                await asyncio.sleep(0.01)
        return found


@contextlib.asynccontextmanager
async def client(port):
    transport, found = await asyncio.get_running_loop().create_datagram_endpoint(
        Client, remote_addr=("127.0.0.1", port)
    )
    try:
        yield found
    finally:
        transport.abort()


async def test_it_answers_all_reads_and_moves_within_the_limits():
    async with simulator(demo=True) as port, client(port) as asker:
        first = await asker.positions()
        assert (first.data_type, len(first.axes)) == (DataType.PULSES, 8)
        moved = await asker.until(asker.positions, lambda found: found.axes != first.axes)
        assert not violations(
            joints_of(PUMA), [each / 1000 * 3.141592653589793 / 180 for each in moved.axes[:6]]
        )
        assert moved.axes[6:] == (0, 0)
        status = await asker.status()
        assert status.first & (Status1.RUNNING | Status1.REMOTE) == Status1.RUNNING | Status1.REMOTE
        assert status.second == Status2.SERVO_ON
        job = payloads.job((await asker.ask(Read(Command.JOB, 1))).data)
        assert (job.name, job.speed_override) == ("DEMO", 10_000)
        assert payloads.axis_names((await asker.ask(Read(Command.AXES, 1))).data) == (*"SLURBT", "", "")
        torques = payloads.torques((await asker.ask(Read(Command.TORQUE, 1))).data)
        assert all(abs(each) <= 100 for each in torques)
        assert payloads.system((await asker.ask(Read(Command.SYSTEM, 11))).data).model == "PUMA560"
        single = await asker.ask(Read(Command.IO, 1, 1, Service.SINGLE))
        assert len(single.data) == 1
        # The pose of the tool in the base frame, in micrometres and 0.0001 degrees.
        pose = payloads.position((await asker.ask(Read(Command.POSITION, 101))).data)
        assert pose.data_type == DataType.BASE
        assert 1e5 < sum(each**2 for each in pose.axes[:3]) ** 0.5 < 2e6
        # A single attribute of the position: the data type.
        single = await asker.ask(Read(Command.POSITION, 1, 1, Service.SINGLE))
        assert single.data == bytes(4)


async def test_what_it_does_not_have_is_an_error_and_nothing_can_be_written():
    async with simulator() as port, client(port) as asker:
        assert (await asker.ask(Read(Command.POSITION, 2))).status == 0x28
        assert (await asker.ask(Read(Command.STATUS, 1, 9, Service.SINGLE))).status == 0x09
        assert (await asker.ask(Read(0x82, 1, 1, Service.SINGLE))).status == 0x08
        assert (await asker.ask(Read(Command.STATUS, 1, 1, 0x10))).status == 0x08
        for broken in (b"", b"YERC", bytes(32), POSITION.encode(1) + b"\0"):
            asker.transport.sendto(broken)
        assert (await asker.ask(STATUS)).status == 0


async def test_a_controller_of_another_size_group_and_factors():
    declared = YaskawaSettings(pulses_per_degree=(-500.0,) * 6, axes=(2, 1, 3, 4, 5, 6), group="R2")
    async with (
        simulator(axis_count=7, sub_codes=False, yaskawa=declared, faults=("fault",)) as port,
        client(port) as asker,
    ):
        data = (await asker.ask(Read(Command.POSITION, 2))).data
        assert len(data) == 48
        home = [float(each) * 180 / 3.141592653589793 for each in joints_of(PUMA).home]
        expected = [home[each] * -500.0 for each in (1, 0, 2, 3, 4, 5)]
        assert payloads.position(data).axes[:6] == pytest.approx(expected, abs=0.6)
        assert len((await asker.ask(Read(Command.ALARM, 1))).data) == 60


async def test_a_fault_stops_the_arm_with_an_alarm_until_it_ends():
    async with simulator(demo=True, faults=("fault@0.5+2",)) as port, client(port) as asker:
        await asker.until(asker.status, lambda found: found.second & Status2.ALARM)
        alarm = payloads.alarm((await asker.ask(Read(Command.ALARM, 1))).data)
        assert (alarm.code, alarm.name) == (4107, "OUT OF RANGE (ABSO DATA)")
        assert payloads.alarm((await asker.ask(Read(Command.ALARM, 2))).data).code == 0
        past = await asker.ask(Read(0x71, 1))
        assert payloads.alarm(past.data) == alarm
        await asker.until(asker.status, lambda found: not found.second & Status2.ALARM)
        await asker.until(asker.status, lambda found: found.first & Status1.RUNNING)


async def test_faults_of_the_data_are_seen():
    async with simulator(faults=("jump", "local", "joints")) as port, client(port) as asker:
        home = (await asker.positions()).axes[0]
        await asker.until(asker.positions, lambda found: abs(found.axes[0] - home) > 9000)
        assert (await asker.status()).first & Status1.TEACH
        assert (await asker.positions()).axes[6]
        assert payloads.axis_names((await asker.ask(Read(Command.AXES, 1))).data)[6] == "E"


async def test_faults_of_the_answers_are_seen():
    async with simulator(faults=("busy", "loss")) as port, client(port) as asker:
        seen = {(await asker.ask(STATUS)).busy for _ in range(6)}
        assert seen == {True, False}
    async with simulator(faults=("flood",)) as port, client(port) as asker:
        asker.send(STATUS)
        assert len([await asker.received.get() for _ in range(50)]) == 50
    async with simulator(faults=("garbage",)) as port, client(port) as asker:
        asker.send(STATUS)
        with pytest.raises(ValueError, match=r"bytes|begin"):
            decode(await asker.received.get())
        assert decode(await asker.received.get()).status == 0
    async with simulator(faults=("burst",)) as port, client(port) as asker:
        begin_s = time.monotonic()
        for _ in range(3):
            asker.send(STATUS)
        numbers = [decode(await asker.received.get()).number for _ in range(3)]
        assert numbers == [3, 2, 1]
        assert time.monotonic() - begin_s > 1.5


async def test_a_refusing_controller_has_no_port_and_a_restarted_one_no_servos():
    async with simulator(faults=("refuse@0.2+1",)) as port, client(port) as asker:

        async def port_state():
            asker.send(STATUS)
            async with asyncio.timeout(0.3):
                return await asker.received.get()

        async with asyncio.timeout(20):
            while True:
                with contextlib.suppress(TimeoutError):
                    if isinstance(await port_state(), ConnectionRefusedError):
                        break
        assert (await asker.ask(STATUS)).status == 0
    async with simulator(demo=True, faults=("restart@0.2+0.5",)) as port, client(port) as asker:
        found = await asker.until(asker.status, lambda found: not found.second & Status2.SERVO_ON)
        assert not found.first & Status1.RUNNING


async def test_settings_that_cannot_be_used_are_refused():
    for options, error, text in (
        ({"robot": "puma560", "axis_count": 5}, SimulatorError, "6 joints, this controller has 5 axes"),
        ({"yaskawa": YaskawaSettings(pulses_per_degree=(1.0,))}, SimulatorError, "has 1 values"),
        ({"yaskawa": YaskawaSettings(group="R9")}, SimulatorError, "R1 to R8"),
        ({"faults": ("deaf",)}, FaultError, "deaf"),
        ({"listen": "192.0.2.1:1"}, ListenError, "no TLS|cannot listen"),
    ):
        with pytest.raises(error, match=text):
            async with simulator(**options):
                pass


def test_controllers_have_port_10040():
    assert PORT == 10040
