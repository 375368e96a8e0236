"""Flood protection: thinned floods, discarded deluges, the newest of a burst; also over real sockets."""

import asyncio
import contextlib
import math
import time

import pytest

from protocol_gateway.link.flood import EventDispatcher, FloodDetector
from protocol_gateway.link.timestamping import EventTime
from protocol_gateway.seam import Activity, JointsReceived, Mode, Refused, StatusReceived
from robomesh.contract.keys import robot_key
from tests.conftest import run
from tests.protocol_gateway.gateway_site import (
    PROMPT,
    STATE,
    A,
    C,
    gateway,
    none_left_out,
    refusal,
    simulator,
    until,
)
from tests.protocol_gateway.old_client import legacy, program
from tests.protocol_gateway.scripted_controller import repeated, scripted_controller
from tests.serving import serving


def flooded(rate_hz, seconds, flood=None, begin_s=10.0):
    detector = flood or FloodDetector()
    for number in range(int(rate_hz * seconds)):
        detector.add_bytes(100, begin_s + number / rate_hz, more_waits=False)
        assert not detector.deluge
        detector.add_units(1)
    return detector


def test_a_thousand_units_a_second_are_no_flood_and_three_thousand_are():
    assert not flooded(1000, 5).active
    assert flooded(3000, 1).active


def test_a_flood_is_over_after_half_a_second_of_calm_and_not_before():
    detector = flooded(3000, 1)
    assert flooded(100, 0.4, detector, 11.0).active
    assert not flooded(100, 1.2, detector, 11.4).active


def test_more_than_a_mebibyte_in_half_a_second_is_a_deluge_until_half_a_second_is_calm():
    detector = FloodDetector()

    def deluge(length, now_s, *, more_waits=False):
        detector.add_bytes(length, now_s, more_waits=more_waits)
        return detector.deluge

    assert not deluge(1 << 20, 10.0)
    assert deluge(1, 10.4)
    assert deluge(1 << 18, 10.6)  # the previous half second was not calm
    assert deluge(1, 11.0)
    assert deluge(1, 11.2, more_waits=True)  # few bytes, but more of them wait
    assert deluge(1, 11.7)
    assert detector.active
    assert not deluge(1, 12.3)
    assert not detector.active


def test_too_many_units_to_parse_are_a_deluge():
    detector = FloodDetector()
    detector.add_bytes(10_000, 10.0, more_waits=False)
    detector.add_units(10_000)
    assert not detector.deluge
    detector.add_units(1)
    assert detector.deluge


class Timers:
    """Scheduled calls, executed by the test."""

    def __init__(self):
        self.calls = []

    def later(self, seconds, call):
        self.calls.append(call)
        return self

    def cancel(self):
        self.calls.clear()


def handed_over(*reads, burst):
    """Return the events dispatched immediately, and those dispatched later."""
    seen, timers, now = [], Timers(), EventTime(1.0, 10**9)
    dispatcher = EventDispatcher(lambda event, date: seen.append(event), timers.later)
    for events in reads:
        dispatcher.dispatch(events, [now] * len(events), burst=burst)
    before = list(seen)
    (call,) = timers.calls or [lambda: None]
    call()
    return before, seen[len(before) :], dispatcher.skipped


def joints(number):
    return JointsReceived((number,))


def test_of_a_split_burst_only_the_newest_is_dispatched_at_its_end():
    reads = [joints(1), joints(2)], [], [joints(3)]
    assert handed_over(*reads, burst=True) == ([], [joints(3)], 2)
    assert handed_over(*reads, burst=False) == ([joints(1), joints(2), joints(3)], [], 0)


def test_of_a_burst_dated_events_and_refusals_are_dispatched_immediately():
    dated = [JointsReceived((1.0,), None, 5.0), JointsReceived((2.0,), None, 5.1), Refused(5, "limit")]
    assert handed_over(dated, burst=True) == (dated, [], 0)


def test_no_deferred_position_follows_a_newer_dated_one():
    undated, dated = joints(1), JointsReceived((2.0,), None, 5.0)
    assert handed_over([undated], [dated], burst=True) == ([dated], [], 1)


def test_deferred_statuses_keep_every_change_and_end_with_the_newest():
    idle, local = StatusReceived(activity=Activity.IDLE), StatusReceived(mode=Mode.LOCAL)
    assert handed_over([idle, local, idle], [local], burst=True) == ([], [idle, local], 0)


# ------------------------------------------------------------------- on real sockets

UNIT = "1#ABSOLUTE.DEG*%.2f;0;0;0;0@"


@contextlib.asynccontextmanager
async def flooding(say):
    """Send 8,000 positions a second, also on a slow machine."""

    async def send_periodically():
        said_s = time.monotonic()
        while True:
            await asyncio.sleep(0.001)
            now_s = time.monotonic()
            say(UNIT % 1.0 * min(1000, round(8000 * (now_s - said_s))))
            said_s = now_s

    task = asyncio.create_task(send_periodically())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def test_a_single_status_in_a_flood_is_used_and_relayed(mesh, tmp_path):
    settings = legacy(commanders={})
    async with (
        scripted_controller() as (port, say, heard),
        gateway(mesh, tmp_path, port, up=False, **PROMPT, legacy_clients=settings) as site,
    ):
        await until(lambda: site.controller.link == STATE.SILENT)
        say("1#STATUS*idle;remote;homed@" + UNIT % 1.0)
        await until(lambda: site.controller.mode == STATE.REMOTE)
        async with program(settings) as old, flooding(say):
            await until(lambda: site.controller.health.flooding)
            await site.lease(A.ACQUIRE)
            for mode, known in (("local", STATE.LOCAL), ("remote", STATE.REMOTE)) * 3:
                say(UNIT % 1.0 * 3 + f"1#STATUS*idle;{mode};homed@" + UNIT % 1.0 * 3)
                await until(lambda known=known: site.controller.mode == known)
                await until(lambda mode=mode: mode in old.words)
            say("1#STATUS*idle;local;homed@1#STATUS*idle;remote;homed@" + UNIT % 1.0)
            await until(lambda: len(site.events("controller.local")) == 4)  # even a single one
            say("1#STATUS*idle;local;homed@" + UNIT % 1.0)
            await until(lambda: len(site.events("controller.local")) == 5)
            move = site.command(C.MOVE_ABSOLUTE, joint_positions=[0.1, 0, 0, 0, 0])
            assert "local mode" in await refusal(move)
        assert b"ABSOLUTE" not in heard


async def test_of_a_flood_the_newest_is_published_200_times_a_second(mesh, tmp_path):
    settings = legacy(commanders={})
    async with (
        scripted_controller() as (port, say, _),
        gateway(mesh, tmp_path, port, up=False, **PROMPT, legacy_clients=settings) as site,
    ):
        await until(lambda: site.controller.link == STATE.SILENT)
        async with program(settings) as old, flooding(say):
            await until(lambda: site.controller.health.flooding)
            rates: tuple[list[float], list[float]] = ([], [])
            for _ in range(5):
                before, units_before, begin_s = len(site.seen["joints"]), len(old.units), time.monotonic()
                await asyncio.sleep(0.5)
                elapsed_s = time.monotonic() - begin_s
                rates[0].append((len(site.seen["joints"]) - before) / elapsed_s)
                rates[1].append((len(old.units) - units_before) / elapsed_s)
            # A busy machine may read data in the half second after their sending.
            for each in rates:
                assert max(each) > 0
                assert min(each) < 250
        assert site.controller.counters.units_skipped > 1000
        # The last state of a flood is published, too.
        say(UNIT % 2.0)
        await until(lambda: site.joints[0] == pytest.approx(math.radians(2.0)))


@contextlib.asynccontextmanager
async def deluging():
    """Run a controller that sends as fast as it is read, while `on` is set: (port, on, heard)."""
    on, heard, tasks = asyncio.Event(), bytearray(), []
    on.set()
    state = b"2#STATUS*idle;remote;homed&ABSOLUTE.DEG*1;0;0;0;0@"

    async def pour(writer):
        while True:
            writer.write(state * 2000 if on.is_set() else state)
            await writer.drain()
            await asyncio.sleep(0.001 if on.is_set() else 0.01)

    async def serve(reader, writer):
        tasks.append(asyncio.create_task(pour(writer)))
        with contextlib.suppress(ConnectionError):
            while data := await reader.read(100):
                heard.extend(data)
        tasks[-1].cancel()

    async with serving(serve) as port:
        try:
            yield port, on, heard
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)


def test_in_a_deluge_stops_and_other_robots_work(mesh, tmp_path):
    async def main():
        async with (
            deluging() as (port, on, heard),
            simulator(demo=True) as calm_port,
            gateway(mesh, tmp_path, port, calm_port, up=False, **PROMPT) as site,
        ):
            await until(
                lambda: "sends far too much data: all of it is discarded" in site.controller.link_text
            )
            assert site.controller.link == STATE.SILENT
            for number in range(3):
                assert (await site.stop(by="wang")).sent
                await until(lambda number=number: heard.count(b"1#COMMAND*stop@") == number + 1)
                assert site.controller.link == STATE.SILENT
                await asyncio.sleep(0.15)
            # By now the last state from before the deluge has arrived: another topic than the link state.
            joints = len(site.seen["joints"])
            calm = site.session.subscribe(robot_key("hall", "arm-2", "joints"), newest=1000)
            await anext(calm)
            taken, begin_s = site.controller.counters.bytes_received, time.monotonic()
            for _ in range(300):
                await anext(calm)
            assert await none_left_out(site.session, calm, "arm-2")
            # The state is published each second.
            await until(lambda: site.controller.counters.bytes_received > taken)
            taken = site.controller.counters.bytes_received - taken
            elapsed_s = time.monotonic() - begin_s
            assert taken < 5e6 * (elapsed_s + 2.0)
            assert len(site.seen["joints"]) == joints
            # Longer than the reconnect timeout of a silent controller.
            await asyncio.sleep(max(0.0, 4.5 - elapsed_s))
            assert site.controller.counters.connections == 1
            await until(lambda: len(site.events("link.deluge")) == 1)
            on.clear()
            await until(lambda: site.controller.link == STATE.UP, timeout_s=40.0)
            await until(lambda: len(site.seen["joints"]) > joints + 20)
            await until(lambda: site.events("link.flooding_ended"))
            assert site.controller.counters.connections == 1

    run(main(), timeout_s=180.0)


async def test_of_undated_delayed_units_only_the_newest_is_published(mesh, tmp_path):
    async with (
        scripted_controller() as (port, say, _),
        gateway(mesh, tmp_path, port, up=False, **PROMPT) as site,
    ):
        await until(lambda: site.controller.link == STATE.SILENT)
        for first in (1.0, 2.0):
            say(UNIT % first)
            await until(lambda: site.seen["joints"])
            await until(lambda first=first: site.joints[0] == pytest.approx(math.radians(first)))
            before = len(site.seen["joints"])
            await asyncio.sleep(0.5)
            skipped = site.controller.counters.units_skipped + 198
            for begin in (10, 110):  # in two pieces, as networks do
                say("".join(UNIT % (0.05 * (begin + number)) for number in range(100)))
            await until(lambda: site.joints[0] == pytest.approx(math.radians(10.45)))
            assert len(site.seen["joints"]) - before <= 2
            await until(lambda skipped=skipped: site.controller.counters.units_skipped >= skipped)


async def test_live_positions_after_a_gap_are_all_published(mesh, tmp_path):
    waist = 0

    def state():
        nonlocal waist
        waist += 1
        return UNIT % (0.1 * waist)

    async with (
        scripted_controller() as (port, say, _),
        gateway(mesh, tmp_path, port, up=False, **PROMPT) as site,
    ):
        await until(lambda: site.controller.link == STATE.SILENT)
        say(state())
        await asyncio.sleep(0.5)
        async with repeated(say, state):
            await until(lambda: len(site.seen["joints"]) > 60)
        # Two units in one read are a burst, on a busy machine.
        assert len(site.seen["joints"]) > 0.7 * waist
