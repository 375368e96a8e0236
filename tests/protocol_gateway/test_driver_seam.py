"""Link with drivers of other shapes: several channels, datagrams, timers, questions; over real sockets."""

import asyncio
import contextlib
import time

import pytest

from protocol_gateway.link.link import ControllerLink, LinkSettings, LinkState
from protocol_gateway.seam import (
    ALL,
    Capabilities,
    Carries,
    Channel,
    Close,
    FateUnknown,
    JointsReceived,
    Open,
    Report,
    Send,
    SetTimer,
)
from protocol_gateway.seam.errors import LinkDownError, NotReadyError
from robomesh import reason_codes as codes
from robomesh.service.loop_turns import LONG_S, MeasuredLoop, turns_of
from tests.ports import free_port
from tests.protocol_gateway.gateway_site import LOOK_S, looks_until
from tests.protocol_gateway.scripted_controller import endless_joints
from tests.protocol_gateway.test_link import Seen, controller, end, until

READ = Channel(name="read", carries=Carries.READING)
STOP = Channel(name="stop", carries=Carries.STOP)
POLLED = Channel(name="polled", carries=ALL, datagrams=True)
EVERY_S = 0.02
STATE = Report((JointsReceived((0.1, 0.2)),), units=1)


class Driver:
    """Driver whose effects the test chooses; it records each event."""

    requests_a_second = 100.0
    capabilities = Capabilities(commands=frozenset())

    def __init__(self, **effects):
        self.told = []
        self._effects = effects

    def _tell(self, what, *values):
        self.told.append((what, *(each.name if isinstance(each, Channel) else each for each in values)))
        effects = self._effects.get(what, ())
        return effects(*values) if callable(effects) else effects

    def started(self, now_s):
        return self._tell("started")

    def opened(self, channel, now_s):
        return self._tell("opened", channel)

    def received(self, channel, data, now_s):
        return self._tell("received", channel, data)

    def skipped(self, channel, now_s):
        return self._tell("skipped", channel)

    def closed(self, channel, now_s):
        return self._tell("closed", channel)

    def timer_ended(self, ended, now_s):
        return self._tell("timer_ended", now_s)

    def command(self, encoded, now_s):
        return self._tell("command", encoded)


class Peer(asyncio.DatagramProtocol):
    """UDP server that answers with the question."""

    def __init__(self):
        self.questions = []

    def connection_made(self, transport):
        self.transport = transport
        self.port = transport.get_extra_info("sockname")[1]

    def datagram_received(self, data, address):
        self.questions.append(data)
        self.asker = address
        self.transport.sendto(data, address)


@contextlib.asynccontextmanager
async def peer(port=0):
    loop = asyncio.get_running_loop()
    transport, found = await loop.create_datagram_endpoint(Peer, local_addr=("127.0.0.1", port))
    try:
        yield found
    finally:
        transport.abort()


@contextlib.asynccontextmanager
async def link(driver, port, **settings):
    seen = Seen()
    seen.fates = []
    arm_link = ControllerLink(
        LinkSettings(host="127.0.0.1", port=port, **settings),
        driver,
        endless_joints(2),
        on_event=seen.event,
        on_status=seen.statuses.append,
        on_fate_unknown=seen.fates.append,
    )
    task = asyncio.create_task(arm_link.run())
    try:
        yield arm_link, seen
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


def polling(**effects):
    """Driver that asks every 20 ms over UDP."""
    asked = {
        "started": (Open(POLLED),),
        "opened": lambda channel: (Send(POLLED, b"?"), SetTimer(0.0)),
        "timer_ended": lambda now_s: (Send(POLLED, b"?"), SetTimer(now_s + EVERY_S)),
        "received": (STATE,),
    }
    return Driver(**asked | effects)


async def test_a_driver_asks_over_udp_by_its_timer():
    driver = polling()
    async with peer() as arm, link(driver, arm.port) as (arm_link, seen):
        await until(lambda: len(seen.events) >= 20)
        assert arm_link.status.state is LinkState.UP
        assert arm_link.counters.units_sent >= 20
        assert ("received", "polled", b"?") in driver.told
    assert driver.told[0] == ("started",)
    assert driver.told[1] == ("opened", "polled")


def test_link_whose_driver_takes_long_is_what_ran_in_a_long_turn():
    def blocked(*received):
        time.sleep(4 * LONG_S)
        return (STATE,)

    async def main():
        causes = []
        turns_of(asyncio.get_running_loop()).on_long = lambda took_s, what: causes.append(what)
        async with peer() as arm, link(polling(received=blocked), arm.port) as (arm_link, _):
            await until(lambda: arm_link in causes)

    with asyncio.Runner(loop_factory=MeasuredLoop) as runner:
        runner.run(main())


async def test_datagrams_of_another_sender_are_not_read():
    driver = polling()
    async with peer() as arm, peer() as other, link(driver, arm.port) as (_, seen):
        await until(lambda: seen.events)
        for _ in range(20):
            other.transport.sendto(b"from elsewhere", arm.asker)
            await asyncio.sleep(0.01)
        assert {told[2] for told in driver.told if told[0] == "received"} == {b"?"}


async def test_a_udp_port_that_nobody_has_is_down_and_comes_back():
    async with peer() as arm:
        port = arm.port
    async with link(polling(), port, reconnect_after_s=1.0) as (arm_link, seen):
        await until(lambda: LinkState.SILENT in seen.states and seen.states[-1] is LinkState.DOWN)
        assert "refused" in arm_link.status.text
        async with peer(port):
            await until(lambda: arm_link.status.state is LinkState.UP)


async def test_a_driver_sends_no_more_questions_than_it_declares(caplog):
    driver = polling(timer_ended=lambda now_s: (Send(POLLED, b"?"),) * 50 + (SetTimer(now_s + EVERY_S),))
    async with peer() as arm, link(driver, arm.port):
        await until(lambda: arm.questions)
        before = len(arm.questions)
        await asyncio.sleep(1.0)
        # 2,500 were wanted. A late timer gives no more than what a second holds.
        assert len(arm.questions) - before <= 2.5 * driver.requests_a_second
    assert "more questions than it declares" in caplog.text


async def test_a_lost_stop_channel_is_no_lost_link_and_refuses_only_what_it_carries():
    async with controller() as reads, controller() as stops:
        driver = Driver(
            started=(Open(READ), Open(STOP, port=stops.port)),
            received=(STATE,),
            command=(Send(STOP, b"stop"),),
        )
        async with link(driver, reads.port) as (arm_link, seen):
            _, read_writer = await reads.next()
            reader, writer = await stops.next()
            read_writer.write(b"state")
            await until(lambda: arm_link.status.state is LinkState.UP)
            arm_link.send(b"stop")
            assert await reader.readexactly(4) == b"stop"
            await end(writer)
            await until(lambda: ("closed", "stop") in driver.told)
            assert arm_link.status.state is LinkState.UP
            assert seen.states == [LinkState.SILENT, LinkState.UP]
            with pytest.raises(LinkDownError):
                arm_link.send(b"stop")
            # It connects again without a command, immediately after a failed stop.
            reader, writer = await stops.next()
            await until(lambda: driver.told.count(("opened", "stop")) == 2)
            arm_link.send(b"stop")
            assert await reader.readexactly(4) == b"stop"
            await end(writer)
            await end(read_writer)


@pytest.mark.parametrize(
    ("alternative", "ways", "arrives"),
    [(True, "nowhere read", True), (False, "nowhere read", False), (True, "nowhere nowhere", False)],
)
async def test_a_command_with_two_ways_needs_one_of_them(alternative, ways, arrives):
    async with controller() as reads:
        channels = {"read": READ, "nowhere": Channel(name="nowhere", carries=Carries.STOP)}
        driver = Driver(
            started=(Open(READ), Open(channels["nowhere"], port=free_port())),
            command=lambda encoded: [
                Send(channels[name], encoded, alternative=alternative) for name in ways.split()
            ],
        )
        async with link(driver, reads.port) as (arm_link, _):
            reader, writer = await reads.next()
            await until(lambda: ("opened", "read") in driver.told)
            if arrives:
                arm_link.send(b"stop")
                assert await reader.readexactly(4) == b"stop"
            else:
                with pytest.raises(LinkDownError):
                    arm_link.send(b"stop")
            await end(writer)


async def test_a_driver_refuses_a_command_and_reports_an_unknown_fate():
    def not_now(encoded):
        raise NotReadyError(codes.OTHER(detail="a motion still runs"))

    async with controller() as reads:
        why = codes.OTHER(detail="its program was paused")
        driver = Driver(started=(Open(READ),), command=not_now, received=(STATE, FateUnknown(why)))
        async with link(driver, reads.port) as (arm_link, seen):
            _, writer = await reads.next()
            with pytest.raises(NotReadyError, match="still runs"):
                arm_link.send(b"move")
            writer.write(b"state")
            await until(lambda: seen.fates == [why])
            assert arm_link.counters.units_sent == 0
            await end(writer)


async def test_what_ends_a_motion_is_sent_however_many_questions_were_sent():
    async with controller() as reads:
        effects = (Send(READ, b"end"), FateUnknown(codes.OTHER(detail="its program was paused")))
        driver = Driver(started=(Open(READ),), received=effects)
        driver.requests_a_second = 0.0
        async with link(driver, reads.port) as (_, seen):
            reader, writer = await reads.next()
            writer.write(b"state")
            assert await reader.readexactly(3) == b"end"
            assert len(seen.fates) == 1
            await end(writer)


async def test_a_driver_moves_a_channel_to_another_port():
    async with controller() as first, controller() as second:
        driver = Driver(
            started=(Open(READ),),
            received=lambda channel, data: (
                (Open(READ, port=second.port),) if data == b"elsewhere" else (STATE,)
            ),
        )
        async with link(driver, first.port) as (arm_link, _):
            _, writer = await first.next()
            writer.write(b"elsewhere")
            _, other = await second.next()
            other.write(b"state")
            await until(lambda: arm_link.status.state is LinkState.UP)
            await end(other)
            await end(writer)


async def test_a_closed_channel_is_not_connected_again():
    async with controller() as arm:
        driver = Driver(started=(Open(READ),), received=lambda channel, data: (STATE, Close(READ)))
        async with link(driver, arm.port) as (_, seen):
            _, writer = await arm.next()
            writer.write(b"state")
            await until(lambda: LinkState.UP in seen.states and seen.states[-1] is LinkState.DOWN)
            await asyncio.sleep(0.6)
            assert arm.connections.empty()
            await end(writer)


async def test_a_command_before_the_link_runs_is_refused_and_makes_it_connect_without_long_pauses():
    driver = Driver(started=(Open(READ),), command=(Send(READ, b"stop"),))
    settings = LinkSettings(host="127.0.0.1", port=free_port())
    arm_link = ControllerLink(settings, driver, endless_joints(2), on_event=Seen().event)
    with pytest.raises(LinkDownError):
        arm_link.send(b"stop")
    task = asyncio.create_task(arm_link.run())
    # With pauses that grow it would take 25 s.
    assert await looks_until(lambda: driver.told.count(("closed", "read")) >= 8) < 15.0 / LOOK_S
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


@pytest.mark.slow
async def test_pauses_between_failed_attempts_grow_also_after_a_connection_of_use():
    driver = Driver(started=(Open(READ),), received=(STATE,))
    async with controller() as arm, link(driver, arm.port) as (arm_link, _):
        _, writer = await arm.next()
        writer.write(b"state")
        await until(lambda: arm_link.status.state is LinkState.UP)
        arm.server.close()
        await end(writer)
        await asyncio.sleep(4.0)
        # At 0, 0.2, 0.6, 1.4 and 3.0 s, a fifth earlier or later; with short pauses it would be 20.
        assert 1 <= driver.told.count(("closed", "read")) <= 7


async def test_an_exception_at_a_timer_ends_the_link():
    def broken(now_s):
        raise ZeroDivisionError

    async with peer() as arm:
        settings = LinkSettings(host="127.0.0.1", port=arm.port)
        arm_link = ControllerLink(
            settings, polling(timer_ended=broken), endless_joints(2), on_event=Seen().event
        )
        with pytest.raises(ZeroDivisionError):
            await arm_link.run()


class Follower(Driver):
    """A driver that connects only while the robot is controlled."""

    def __init__(self, **effects):
        super().__init__(**effects)
        self.controls = []

    def controlled(self, taken, now_s):
        self.controls.append(taken)
        return (Open(POLLED) if taken else Close(POLLED),)


async def test_a_driver_may_follow_who_controls_the_robot():
    async with peer() as controller:
        driver = Follower(started=(), opened=lambda channel: (Send(POLLED, b"?"),))
        async with link(driver, controller.port) as (arm_link, _):
            await until(lambda: driver.controls == [False])
            arm_link.controlled(True)
            await until(lambda: controller.questions)
            assert arm_link.carries(POLLED.carries)
            arm_link.controlled(False)
            assert not arm_link.carries(POLLED.carries)
            assert driver.controls == [False, True, False]
        # A driver without the method is not told.
        async with link(polling(), controller.port) as (arm_link, _):
            arm_link.controlled(True)
