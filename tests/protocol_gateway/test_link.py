"""Link over real sockets; a plain TCP server simulates controllers that misbehave."""

import asyncio
import contextlib
import time

import pytest

from controllers.unit.driver import UnitDriver
from protocol_gateway.link.link import ControllerLink, LinkSettings, LinkState
from protocol_gateway.seam import JointsReceived, MalformedReceived, Refused, UnknownReceived
from protocol_gateway.seam.errors import LinkCloggedError, LinkDownError
from robots.kinematics.joints import JointType
from tests.ports import free_port
from tests.protocol_gateway.scripted_controller import endless_joints

STATE = b"1#ABSOLUTE.DEG*10.00;20.00@"
STOP = b"1#COMMAND*stop@"


class Controller:
    """TCP server that sends only the test's bytes."""

    def __init__(self):
        self.connections = asyncio.Queue()

    async def joined(self, reader, writer):
        await self.connections.put((reader, writer))

    async def next(self):
        return await self.connections.get()


@contextlib.asynccontextmanager
async def controller(port=0):
    peer = Controller()
    server = await asyncio.start_server(peer.joined, "127.0.0.1", port)
    peer.server = server
    peer.port = server.sockets[0].getsockname()[1]
    writers = []
    try:
        yield peer
    finally:
        while not peer.connections.empty():
            writers.append(peer.connections.get_nowait()[1])
        for writer in writers:
            writer.transport.abort()
        server.close()
        await server.wait_closed()


class Seen:
    def __init__(self):
        self.events = []
        self.received = []
        self.statuses = []

    def event(self, event, received):
        self.events.append(event)
        self.received.append(received)

    @property
    def states(self):
        return [status.state for status in self.statuses]


@contextlib.asynccontextmanager
async def link(port, **settings):
    seen = Seen()
    arm_link = ControllerLink(
        LinkSettings(host="127.0.0.1", port=port, **settings),
        UnitDriver((JointType.ROTARY, JointType.ROTARY)),
        endless_joints(2),
        on_event=seen.event,
        on_status=seen.statuses.append,
    )
    task = asyncio.create_task(arm_link.run())
    try:
        yield arm_link, seen
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


async def until(condition, timeout_s=30.0):
    async with asyncio.timeout(timeout_s):
        while not condition():
            await asyncio.sleep(0.005)


def send_often(arm_link, unit):
    for _ in range(10_000):
        arm_link.send(unit)


async def send_on(arm_link):
    for _ in range(10_000):
        arm_link.send(STOP)
        await asyncio.sleep(0)


async def end(writer):
    writer.transport.abort()
    with contextlib.suppress(OSError):
        await writer.wait_closed()


async def test_the_link_is_up_with_units_and_events_have_their_receive_time():
    async with controller() as arm, link(arm.port) as (arm_link, seen):
        _, writer = await arm.next()
        await until(lambda: seen.states == [LinkState.SILENT])
        before = time.time_ns()
        writer.write(STATE + STATE)
        await until(lambda: len(seen.events) >= 2)
        assert arm_link.status.state is LinkState.UP
        assert all(isinstance(event, JointsReceived) for event in seen.events)
        assert before <= seen.received[0].wall_ns <= time.time_ns()
        assert arm_link.last_received == seen.received[-1]
        await end(writer)


async def test_a_split_unit_is_stamped_at_its_last_byte():
    async with controller() as arm, link(arm.port) as (_, seen):
        _, writer = await arm.next()
        writer.write(STATE[:10])
        await asyncio.sleep(0.1)
        late = time.time_ns()
        writer.write(STATE[10:])
        await until(lambda: seen.events)
        assert seen.received[0].wall_ns >= late
        await end(writer)


async def test_errors_are_counted():
    async with controller() as arm, link(arm.port) as (arm_link, seen):
        reader, writer = await arm.next()
        writer.write(STATE + b"nonsense@" + b"1#FORCE*1@" + b"1#ERROR*5;joint 1@")
        await until(lambda: len(seen.events) >= 4)
        assert [type(event) for event in seen.events] == [
            JointsReceived,
            MalformedReceived,
            UnknownReceived,
            Refused,
        ]
        arm_link.send(STOP)
        assert await reader.readexactly(len(STOP)) == STOP
        counters = arm_link.counters
        assert (counters.units_received, counters.units_malformed) == (3, 1)
        assert (counters.records_unknown, counters.refusals, counters.connections) == (1, 1, 1)
        assert (counters.units_sent, counters.bytes_sent) == (1, len(STOP))
        assert counters.bytes_received == len(STATE) + 9 + 10 + 18
        await end(writer)


async def test_a_silent_controller_is_reported_and_reconnected():
    patience = {"stale_after_s": 0.2, "reconnect_after_s": 0.5}
    async with controller() as arm, link(arm.port, **patience) as (arm_link, seen):
        _, writer = await arm.next()
        writer.write(STATE)
        await until(lambda: arm_link.status.state is LinkState.SILENT and LinkState.UP in seen.states)
        assert "sends nothing" in arm_link.status.text
        # The socket is still open, so a stop can be sent.
        arm_link.send(STOP)
        _, again = await arm.next()
        again.write(STATE)
        await until(lambda: seen.states.count(LinkState.UP) == 2)
        assert arm_link.counters.connections == 2
        assert LinkState.DOWN in seen.states
        await end(writer)
        await end(again)


async def test_garbage_alone_does_not_make_a_link_look_alive():
    async with controller() as arm, link(arm.port) as (arm_link, seen):
        _, writer = await arm.next()
        writer.write(b"nonsense@" * 10)
        await until(lambda: len(seen.events) >= 10)
        assert arm_link.status.state is LinkState.SILENT
        assert arm_link.last_received is None
        await end(writer)


async def test_a_reconnection_discards_half_a_unit():
    async with controller() as arm, link(arm.port) as (arm_link, seen):
        _, writer = await arm.next()
        writer.write(STATE + STATE[:12])
        await until(lambda: len(seen.events) >= 1)
        await end(writer)
        await until(lambda: arm_link.status.state is LinkState.DOWN)
        _, again = await arm.next()
        again.write(STATE)
        await until(lambda: len(seen.events) >= 2)
        assert isinstance(seen.events[1], JointsReceived)
        await end(again)


async def test_a_missing_controller_is_reported_and_connected_later():
    port = free_port()
    async with link(port) as (arm_link, seen):
        await until(lambda: seen.statuses)
        assert arm_link.status.state is LinkState.DOWN
        assert arm_link.status.text == f"cannot connect to 127.0.0.1:{port}: connection refused"
        with pytest.raises(LinkDownError, match="connection refused"):
            arm_link.send(STOP)
        async with controller(port) as arm:
            _, writer = await arm.next()
            writer.write(STATE)
            await until(lambda: arm_link.status.state is LinkState.UP)
            await end(writer)


async def test_a_refused_connection_is_reported_with_the_controllers_text():
    async with controller() as arm, link(arm.port) as (arm_link, seen):
        _, writer = await arm.next()
        writer.write(b"1#ERROR*1;too many clients@")
        writer.close()
        await until(lambda: LinkState.DOWN in seen.states)
        assert "too many clients" in arm_link.status.text
        assert LinkState.UP not in seen.states
        await end(writer)


async def test_an_answer_alone_does_not_bring_a_silent_link_up_but_the_state_after_it_does():
    async with controller() as arm, link(arm.port, stale_after_s=0.1) as (arm_link, seen):
        _, writer = await arm.next()
        writer.write(b"1#ERROR*8;stopped@")
        await until(lambda: seen.events)
        assert arm_link.status.state is LinkState.SILENT
        writer.write(b"2#STATUS*idle&ERROR*8;stopped@")
        await until(lambda: arm_link.status.state is LinkState.UP)
        await end(writer)


async def test_after_a_failed_send_the_link_reconnects_without_long_pauses():
    tries = 0

    async def refuse(arm):
        nonlocal tries
        while True:
            _, writer = await arm.next()
            tries += 1
            writer.write(b"1#ERROR*1;too many clients@")
            writer.close()

    async with controller() as arm, link(arm.port) as (arm_link, _):
        refusing = asyncio.create_task(refuse(arm))
        # The next pause is 1.6 s, the one after it 3.2 s.
        await until(lambda: tries >= 4 and arm_link.status.state is LinkState.DOWN)
        with pytest.raises(LinkDownError):
            arm_link.send(STOP)
        before, begin_s = tries, time.monotonic()
        await until(lambda: tries >= before + 5)
        assert time.monotonic() - begin_s > 0.5  # but not continuously
        refusing.cancel()
        reader, writer = await arm.next()
        arm_link.send(STOP)
        assert await reader.readexactly(len(STOP)) == STOP
        await end(writer)


async def test_a_unit_that_does_not_fit_is_an_error_and_is_never_completed_later():
    async with controller() as arm, link(arm.port) as (arm_link, _):
        reader, writer = await arm.next()
        writer.transport.pause_reading()
        writer.write(STATE)
        await until(lambda: arm_link.status.state is LinkState.UP)
        unit = STOP.rjust(4000)
        with pytest.raises(LinkCloggedError):
            send_often(arm_link, unit)
        sent = arm_link.counters.units_sent
        with pytest.raises(LinkDownError):
            arm_link.send(STOP)
        await until(lambda: arm_link.status.state is LinkState.DOWN)
        writer.transport.resume_reading()
        with contextlib.suppress(ConnectionError):
            assert (await reader.read()).count(b"@") <= sent
        await end(writer)


async def test_the_last_unit_arrives_while_the_controller_sends():
    async with controller() as arm:
        async with link(arm.port) as (arm_link, _):
            reader, writer = await arm.next()
            writer.write(STATE)
            await until(lambda: arm_link.status.state is LinkState.UP)
            writer.transport.pause_reading()
            writer.write(STATE * 500)  # still unread when the link is closed
            arm_link.send(STOP)
        writer.transport.resume_reading()
        assert await reader.read() == STOP
        await end(writer)


async def test_nothing_is_sent_over_a_connection_that_has_just_broken():
    async with controller() as arm, link(arm.port) as (arm_link, _):
        _, writer = await arm.next()
        writer.write(STATE)
        await until(lambda: arm_link.status.state is LinkState.UP)
        await end(writer)
        # The first unit may still be written before the end of the socket is detected.
        with pytest.raises(LinkDownError):
            await send_on(arm_link)


async def test_an_exception_in_a_callback_ends_the_link():
    def broken(event, received):
        raise ZeroDivisionError

    async with controller() as arm:
        driver = UnitDriver((JointType.ROTARY, JointType.ROTARY))
        settings = LinkSettings(host="127.0.0.1", port=arm.port)
        arm_link = ControllerLink(settings, driver, endless_joints(2), on_event=broken)
        task = asyncio.create_task(arm_link.run())
        _, writer = await arm.next()
        writer.write(STATE)
        with pytest.raises(ZeroDivisionError):
            await task
        await end(writer)


@pytest.mark.slow
async def test_the_rate_is_known_after_a_second_and_0_without_units():
    async with controller() as arm, link(arm.port) as (arm_link, _):
        _, writer = await arm.next()
        begin, count = time.monotonic(), 0
        while count < 75 or not arm_link.rate_hz:
            writer.write(STATE)
            count += 1
            await asyncio.sleep(0.02)
        assert 0.25 * count / (time.monotonic() - begin) < arm_link.rate_hz <= 50.0
        await end(writer)
        await until(lambda: arm_link.rate_hz == 0.0)


async def test_delayed_units_are_not_stamped_as_new():
    def unit_at(clock_s):
        return b"2#ABSOLUTE.DEG*10.00;20.00&TIME*%.2f@" % clock_s

    async with controller() as arm, link(arm.port, stale_after_s=0.4) as (arm_link, seen):
        _, writer = await arm.next()
        writer.write(unit_at(50.0))
        await until(lambda: LinkState.UP in seen.states)
        begin = seen.received[0]
        await until(lambda: arm_link.status.state is LinkState.SILENT)
        await asyncio.sleep(0.6)
        writer.write(unit_at(50.1) + unit_at(50.2))
        await until(lambda: len(seen.events) >= 3)
        assert arm_link.status.state is LinkState.SILENT
        assert seen.received[2].monotonic_s == pytest.approx(begin.monotonic_s + 0.2)
        assert seen.received[2].wall_ns == pytest.approx(begin.wall_ns + 2e8, abs=5e6)
        writer.write(unit_at(50.0 + time.monotonic() - begin.monotonic_s))
        await until(lambda: seen.states.count(LinkState.UP) == 2)
        await end(writer)


async def test_the_link_reports_round_trip_answers_and_losses():
    def unit_at(clock_s, activity):
        return b"3#ABSOLUTE.DEG*10.00;20.00&STATUS*%b;remote&TIME*%.2f@" % (activity, clock_s)

    async with controller() as arm, link(arm.port) as (arm_link, seen):
        reader, writer = await arm.next()
        begin_s = time.monotonic()
        for number in range(60):
            if number not in (20, 21):
                writer.write(unit_at(50.0 + 0.01 * number, b"idle"))
                await asyncio.sleep(0.005)
        await until(lambda: len(seen.events) >= 2 * 58)
        assert arm_link.counters.units_lost == 2
        took_s = time.monotonic() - begin_s
        assert 0.0 < arm_link.health.network_round_trip_s < took_s
        assert 0.0 <= arm_link.health.jitter_s < took_s
        assert arm_link.health.answer_s is None
        sent_s = time.monotonic()
        arm_link.send(STOP)
        await reader.readexactly(len(STOP))
        await asyncio.sleep(0.1)
        writer.write(unit_at(51.0, b"stopped"))
        await until(lambda: arm_link.health.answer_s is not None)
        assert 0.1 <= arm_link.health.answer_s <= time.monotonic() - sent_s
        await end(writer)
