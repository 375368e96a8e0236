"""The simulated controller over real sockets, its motion as a function of time."""

import asyncio
import contextlib
import itertools
import socket
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol_gateway.core.records import (
    AbsolutePositions,
    Command,
    Error,
    RelativePositions,
    Status,
    Time,
    Velocities,
    read_records,
    write_unit,
)
from protocol_gateway.core.stream import Malformed, Unit, UnitStream
from robots.description import load
from robots.joints import joints_of, violations
from robots.model import build_model, tool_placement
from services.errors import ListenError
from services.simulator.controller import Controller
from services.simulator.demo import demo_tour
from services.simulator.errors import SimulatorError
from services.simulator.faults import parse_faults
from services.simulator.motion import Motion
from services.simulator.simulator import Settings, serve
from tests.conftest import run

PT600 = load("pt600")
JOINTS = joints_of(PT600)
DEGREES = 180.0 / np.pi
TARGET = (20.0, 60.0, -40.0, 10.0, 90.0)
HOME = tuple(np.round(JOINTS.home * DEGREES, 6).tolist())

# ------------------------------------------------------------------ the controller, time as an argument


class Bench:
    """A controller with a clock that the test turns."""

    def __init__(self, **options):
        self.now_s = 100.0
        self.controller = Controller(JOINTS, **{"codes": {}, "demo": None, "now_s": self.now_s, **options})

    def obey(self, *records):
        return self.controller.obey(records, self.now_s)

    def word(self, *words):
        return self.obey(Command(words))

    def pass_s(self, seconds):
        told = []
        for _ in range(round(seconds * 100)):
            self.now_s += 0.01
            self.controller.tick(self.now_s)
            told.append(self.told())
        return told

    def told(self):
        return read_records(self.controller.told(self.now_s)[:-1])

    @property
    def positions(self):
        return self.told()[0].values

    @property
    def words(self):
        return self.told()[2].words


def test_a_controller_boots_at_rest_and_does_not_claim_to_be_homed():
    bench = Bench()
    positions, velocities, status, clock = bench.told()
    assert positions == AbsolutePositions(HOME)
    assert velocities == Velocities((0.0,) * 5)
    assert status == Status(("idle", "remote"))
    assert clock == Time(0.0)


def test_homing_is_told_and_ends_homed():
    bench = Bench()
    bench.obey(AbsolutePositions(TARGET))
    bench.pass_s(4.0)
    bench.word("home")
    bench.pass_s(0.1)
    assert bench.words == ("homing", "remote")
    bench.pass_s(5.0)
    assert bench.words == ("idle", "remote", "homed")
    assert bench.positions == HOME


def test_the_papers_unit_traces_homes_and_then_moves_in_this_order():
    bench = Bench()
    assert bench.obey(Command(("trace", "home")), AbsolutePositions(TARGET)) is None
    bench.pass_s(0.3)
    assert bench.words == ("homing", "remote", "trace")
    bench.pass_s(5.0)
    assert bench.words == ("idle", "remote", "homed", "trace")
    assert bench.positions == TARGET


def test_a_relative_target_is_added_to_where_the_arm_is():
    bench = Bench()
    bench.obey(RelativePositions((10.0, 0.0, 0.0, 0.0, -10.0)), RelativePositions((1.0, 0.0, 0.0, 0.0, 0.0)))
    bench.pass_s(3.0)
    assert bench.positions == (HOME[0] + 11.0, *HOME[1:4], HOME[4] - 10.0)


def test_stop_brakes_hard_latches_and_forgets_what_was_to_come():
    bench = Bench()
    bench.obey(AbsolutePositions(TARGET), AbsolutePositions(HOME))
    bench.pass_s(0.5)
    bench.word("stop")
    assert bench.words[0] == "moving"
    bench.pass_s(0.4)
    assert bench.words == ("stopped", "remote")
    rest = bench.positions
    assert bench.obey(AbsolutePositions(TARGET)) == Error(8, "stopped, reset first")
    assert bench.word("home") == Error(8, "stopped, reset first")
    bench.word("resume")
    bench.pass_s(1.0)
    assert bench.positions == rest
    bench.word("reset")
    bench.pass_s(1.0)
    assert bench.words == ("idle", "remote")
    assert bench.positions == rest


def test_hold_comes_to_rest_and_resume_goes_on_to_the_target():
    bench = Bench()
    bench.obey(AbsolutePositions(TARGET))
    bench.pass_s(0.3)
    bench.word("hold")
    bench.pass_s(0.5)
    assert bench.words[0] == "holding"
    held = bench.positions
    assert bench.obey(AbsolutePositions(HOME)) == Error(8, "holding, resume or reset first")
    bench.pass_s(1.0)
    assert bench.positions == held
    bench.word("resume")
    bench.pass_s(3.0)
    assert bench.positions == TARGET
    assert bench.words[0] == "idle"


def test_reset_after_hold_forgets_the_motion():
    bench = Bench()
    bench.obey(AbsolutePositions(TARGET))
    bench.pass_s(0.3)
    bench.word("hold")
    bench.pass_s(0.5)
    held = bench.positions
    bench.word("reset")
    bench.pass_s(1.0)
    assert bench.positions == held
    assert bench.words[0] == "idle"


def test_speed_slows_a_motion_that_runs():
    fast, slow = Bench(), Bench()
    for bench in (fast, slow):
        bench.obey(AbsolutePositions(TARGET))
        bench.pass_s(0.2)
    slow.word("speed=10")
    slow.pass_s(0.5)
    top = max(abs(v) for told in slow.pass_s(0.5) for v in told[1].values)
    assert top <= 0.1 * JOINTS.max_speed.max() * DEGREES + 1e-6
    fast.pass_s(1.0)
    assert fast.positions == TARGET
    slow.pass_s(20.0)
    assert slow.positions == TARGET


def test_a_new_target_takes_the_place_of_the_old_one_without_a_jump():
    bench = Bench()
    bench.obey(AbsolutePositions(TARGET))
    before = bench.pass_s(0.4)[-1]
    bench.obey(AbsolutePositions(HOME))
    after = bench.told()
    assert after[0].values == pytest.approx(before[0].values, abs=1e-5)
    assert after[1].values == pytest.approx(before[1].values, abs=1e-4)
    bench.pass_s(4.0)
    assert bench.positions == HOME


REFUSED = [
    ((AbsolutePositions((1.0, 2.0)),), 4, "2 values for 5 joints"),
    (
        (AbsolutePositions((500.0, *TARGET[1:])),),
        5,
        "joint waist at 500.00 deg is beyond its limit 150.00 deg",
    ),
    ((AbsolutePositions((0.0, -29.0, -109.0, 0.0, 0.0)),), 5, "shoulder + elbow"),
    ((RelativePositions((200.0, 0.0, 0.0, 0.0, 0.0)),), 5, "waist"),
    ((Command(("dance",)),), 3, "unknown word dance"),
    ((Command(("speed=0",)),), 5, "outside 1-100"),
    ((Command(("speed=101",)),), 5, "outside 1-100"),
    ((Command(("speed=fast",)),), 2, "not a finite number"),
]


@pytest.mark.parametrize(("records", "number", "text"), REFUSED)
def test_a_unit_that_cannot_be_done_is_answered_and_nothing_in_it_is_done(records, number, text):
    bench = Bench()
    refusal = bench.obey(Command(("trace",)), AbsolutePositions(TARGET), *records)
    assert refusal.number == number
    assert text in refusal.text
    assert write_unit((refusal,))
    bench.pass_s(1.0)
    assert bench.positions == HOME
    assert bench.words == ("idle", "remote")


def test_a_reset_allows_the_motion_behind_it_in_the_same_unit():
    bench = Bench()
    bench.word("stop")
    assert bench.obey(Command(("reset",)), AbsolutePositions(TARGET)) is None
    bench.pass_s(3.0)
    assert bench.positions == TARGET


def test_a_stop_is_done_even_when_the_rest_of_its_unit_is_refused():
    bench = Bench()
    bench.obey(AbsolutePositions(TARGET))
    bench.pass_s(0.2)
    assert bench.word("stop", "dance").number == 3
    bench.pass_s(0.5)
    assert bench.words[0] == "stopped"


def test_states_and_answers_of_others_are_not_commands():
    bench = Bench()
    told = bench.told()
    assert bench.obey(told[1], told[2], told[3], Error(9, "x")) is None
    bench.pass_s(0.5)
    assert bench.positions == HOME


positions = st.lists(st.floats(0.0, 1.0), min_size=5, max_size=5).map(
    lambda parts: JOINTS.lower + np.array(parts) * (JOINTS.upper - JOINTS.lower)
)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(positions, st.floats(0.02, 2.0), st.floats(0.01, 1.0)), min_size=1, max_size=5))
def test_motion_keeps_limits_speeds_and_accelerations_however_it_is_interrupted(legs):
    motion, now_s = Motion(JOINTS, JOINTS.home.copy()), 0.0
    top = 0.0
    for target, after_s, speed in legs:
        motion.move(target, now_s, speed=speed)
        # A motion that is slowed first brakes down to its new speed.
        top = max(top, speed)
        for at_s in np.linspace(now_s, now_s + after_s, 25):
            state = motion.state(at_s)
            assert np.all(state.positions >= JOINTS.lower - 1e-6)
            assert np.all(state.positions <= JOINTS.upper + 1e-6)
            assert np.all(np.abs(state.velocities) <= JOINTS.max_speed * top + 1e-6)
            assert np.all(np.abs(state.accelerations) <= JOINTS.max_acceleration + 1e-6)
        now_s += after_s
    motion.brake(now_s)
    assert motion.end_s - now_s < 1.0
    assert np.all(motion.state(motion.end_s).velocities == 0.0)


# ------------------------------------------------------------------------------------------ demo


@pytest.mark.parametrize("robot", ["pt500", "pt600", "puma560"])
def test_the_demo_tours_several_poses_within_limits_and_above_the_floor(robot):
    description = load(robot)
    joints, model = joints_of(description), build_model(description)
    tour = list(itertools.islice(demo_tour(description), 30))
    assert len({tuple(pose) for pose in tour}) >= 6
    motion, now_s = Motion(joints, joints.home.copy()), 0.0
    for pose in tour[:10]:
        motion.move(pose, now_s, speed=1.0)
        for at_s in np.linspace(now_s, motion.end_s, 20):
            positions = motion.state(at_s).positions
            assert not violations(joints, positions)
            assert tool_placement(model, positions)[2, 3] > 0.1
        now_s = motion.end_s


def test_the_demo_moves_until_the_first_motion_command_and_begins_homed():
    bench = Bench(demo=demo_tour(PT600))
    bench.pass_s(2.0)
    assert bench.words == ("moving", "remote", "homed")
    bench.word("trace")
    assert bench.word("dance").number == 3
    before = bench.positions
    bench.pass_s(6.0)
    assert bench.positions != before
    bench.obey(AbsolutePositions(TARGET))
    bench.pass_s(20.0)
    assert bench.positions == TARGET
    assert bench.words == ("idle", "remote", "homed", "trace")


def test_a_stop_ends_the_demo_for_good():
    bench = Bench(demo=demo_tour(PT600))
    bench.pass_s(1.0)
    bench.word("stop")
    bench.pass_s(1.0)
    assert bench.words[0] == "stopped"
    bench.word("reset")
    rest = bench.positions
    bench.pass_s(5.0)
    assert bench.positions == rest


# ---------------------------------------------------------------------------------- over sockets


@contextlib.asynccontextmanager
async def simulator(**options):
    ready = asyncio.get_running_loop().create_future()
    task = asyncio.create_task(serve(Settings(robot="pt600", **options), ready=ready.set_result))
    await asyncio.wait([ready, task], return_when=asyncio.FIRST_COMPLETED)
    if task.done():
        await task
    try:
        yield int(ready.result().removeprefix("listening on 127.0.0.1:"))
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


class Client:
    """A client: what it reads, unit by unit."""

    def __init__(self, reader, writer):
        self.reader, self.writer = reader, writer
        self.stream = UnitStream()
        self.events = []

    async def next(self, wanted):
        """The next event that is wanted."""
        while True:
            while self.events:
                event = self.events.pop(0)
                if wanted(event):
                    return event
            data = await self.reader.read(32)
            if not data:
                raise EOFError
            self.events += self.stream.receive(data)

    async def error(self):
        unit = await self.next(lambda e: isinstance(e, Unit) and isinstance(e.records[0], Error))
        return unit.records[0]

    async def state(self, wanted):
        return (
            await self.next(lambda e: isinstance(e, Unit) and len(e.records) == 4 and wanted(*e.records))
        ).records

    def send(self, data):
        self.writer.write(data)


@contextlib.asynccontextmanager
async def client(port):
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        yield Client(reader, writer)
    finally:
        writer.transport.abort()
        with contextlib.suppress(OSError):
            await writer.wait_closed()


def test_states_come_at_the_rate_and_the_clock_of_the_controller_runs():
    async def main():
        async with simulator() as port, client(port) as one:
            first = await one.state(lambda *records: True)
            begin_s = time.monotonic()
            for _ in range(100):
                last = await one.state(lambda *records: True)
            assert time.monotonic() - begin_s > 0.9
            assert last[3].seconds - first[3].seconds == pytest.approx(time.monotonic() - begin_s, abs=0.2)

    run(main())


def test_every_client_sees_the_motion_that_one_of_them_asked_for():
    async def main():
        async with simulator() as port, client(port) as one, client(port) as two:
            one.send(b"2# COMMAND* trace; home&ABSOLUTE.DEG* 20.00; 60.00; - 40.00; 10.00; 90.00@")

            def arrived(positions, velocities, status, clock):
                return positions.values == TARGET and status.words == ("idle", "remote", "homed", "trace")

            await asyncio.gather(one.state(arrived), two.state(arrived))

    run(main())


def test_a_refused_unit_is_answered_to_its_sender():
    async def main():
        async with simulator() as port, client(port) as one:
            one.send(b"2#COMMAND*stop@")
            assert await one.error() == Error(2, "malformed, the count says 2 records, there are 1")
            one.send(b"1#ABSOLUTE.DEG*0;0@")
            assert await one.error() == Error(4, "2 values for 5 joints")
            one.send(b"1#FORCE*1@")
            assert (await one.error()).number == 3

    run(main())


def test_numbers_instead_of_names_both_ways():
    async def main():
        codes = {2: "ABSOLUTE.DEG", 101: "COMMAND:home"}
        async with simulator(codes=codes) as port, client(port) as one:
            unit = await one.next(lambda event: True)
            assert unit.data.startswith(b"4#2*0.00;90.00;")
            one.send(b"1#101@")
            await one.state(lambda p, v, status, t: status.words[0] == "homing")

    run(main())


def test_a_client_past_the_maximum_is_told_so_and_closed():
    async def main():
        async with simulator(max_clients=1) as port, client(port) as one:
            await one.state(lambda *records: True)
            async with client(port) as two:
                assert await two.reader.read() == b"1#ERROR*1;too many clients@"
            await one.state(lambda *records: True)

    run(main())


def test_a_place_that_a_client_leaves_is_free():
    async def main():
        async with simulator(max_clients=1) as port:
            for _ in range(3):
                async with client(port) as one:
                    await one.state(lambda *records: True)
                await asyncio.sleep(0.05)

    run(main())


def test_a_client_that_does_not_read_delays_nobody_gets_the_newest_state_and_is_closed():
    async def main():
        async with simulator(rate_hz=1000.0) as port, client(port) as quick:
            with socket.socket() as slow:
                slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                slow.connect(("127.0.0.1", port))
                begin_s = time.monotonic()
                worst_s, last_s = 0.0, begin_s
                while time.monotonic() - begin_s < 6.5:
                    await quick.state(lambda *records: True)
                    worst_s = max(worst_s, time.monotonic() - last_s)
                    last_s = time.monotonic()
                assert worst_s < 0.5
                # Closed with what it had not read still in its buffers.
                slow.settimeout(2.0)
                with contextlib.suppress(ConnectionError):
                    while slow.recv(65536):
                        pass

    run(main())


def test_frozen_the_socket_stays_open_and_nothing_comes():
    async def main():
        async with simulator(faults=("freeze@0.3",)) as port, client(port) as one:
            await one.state(lambda *records: True)
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(one.next(lambda event: False), 1.5)
            one.send(b"1#COMMAND*stop@")

    run(main())


def test_garbage_comes_between_good_units_and_harms_none():
    async def main():
        async with simulator(faults=("garbage",), rate_hz=500.0) as port, client(port) as one:
            reasons = {(await one.next(lambda e: isinstance(e, Malformed))).reason for _ in range(20)}
            assert len(reasons) >= 8
            await one.state(lambda p, v, status, t: p.values == HOME)

    run(main())


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"listen": "here"}, ListenError, "HOST:PORT"),
        ({"listen": "0.0.0.0:0"}, ListenError, "insecure = true"),
        ({"faults": ("melt",)}, SimulatorError, "freeze or garbage"),
        ({"faults": ("freeze@soon",)}, SimulatorError, "freeze@soon"),
        ({"rate_hz": 0.0}, SimulatorError, "rate 0 Hz"),
        ({"max_clients": 0}, SimulatorError, "1 or more"),
    ],
)
def test_settings_that_make_no_controller_are_refused_in_one_line(options, error, text):
    async def main():
        async with simulator(**options):
            pass

    with pytest.raises(error, match=text) as caught:
        run(main())
    assert "\n" not in str(caught.value)


def test_a_port_in_use_is_told_in_one_line():
    async def main():
        async with simulator() as port:
            with pytest.raises(ListenError, match="address already in use"):
                await serve(Settings(robot="pt600", listen=f"127.0.0.1:{port}"))

    run(main())


def test_a_fault_says_when_it_begins():
    assert parse_faults(("freeze@2.5", "garbage")) == {"freeze": 2.5, "garbage": 0.0}
