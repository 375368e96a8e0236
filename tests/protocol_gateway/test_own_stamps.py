"""Every controller unit has a different stamp, and data computed from it carry the same stamp."""

import asyncio
import contextlib
import time
from collections import defaultdict
from itertools import pairwise
from statistics import median

import pytest

from robomesh.wire.session import open_session
from tests.conftest import run
from tests.protocol_gateway.gateway_site import gateway, until
from tests.serving import serving

UNIT = b"1#ABSOLUTE.DEG*%.2f;90;-90;0;0@"
TIMED = b"2#ABSOLUTE.DEG*%.2f;90;-90;0;0&TIME*%.6f@"
MS = 1_000_000
SEVERAL, ROUNDS = 4, 40


class Samples:
    """Received stamps and first joints of a robot, in order, by publisher identity."""

    def __init__(self):
        self.by_identity = defaultdict(list)
        self.count = 0

    def take(self, sample):
        header, states = sample.header, sample.message()
        assert states.timestamp.ToNanoseconds() == header.source_time_ns
        self.by_identity[header.publisher].append((header.source_time_ns, states.joints[0].position))
        self.count += 1

    @property
    def spans_ns(self):
        """Return the intervals between the stamps of one identity."""
        return self.spans_after(0)

    def spans_after(self, first):
        """Return the same without the first ones of each identity."""
        return [
            later - earlier
            for samples in self.by_identity.values()
            for (earlier, _), (later, _) in pairwise(samples[first:])
        ]


async def seen_of(mesh, folder, say):
    """Return what a monitor receives from a controller; `say(writer)` returns the number of units sent."""
    sent = asyncio.get_running_loop().create_future()

    async def serve(reader, writer):
        with contextlib.suppress(ConnectionError):
            sent.set_result(await say(writer))
            await reader.read()

    samples = Samples()
    async with open_session(mesh) as monitor:
        subscription = monitor.subscribe("robomesh/hall/arm/joints", history=False, newest=1000)

        async def read():
            async for sample in subscription:
                samples.take(sample)

        reading = asyncio.create_task(read())
        async with (
            serving(serve) as port,
            gateway(mesh, folder, port, up=False, stale_after_s=5.0, reconnect_after_s=20.0),
        ):
            count = await sent
            await until(lambda: samples.count >= count)
        reading.cancel()
        await asyncio.gather(reading, return_exceptions=True)
    return samples


def test_units_of_one_read_are_spaced_like_time(mesh, tmp_path):
    async def say(writer):
        begin_s = time.monotonic()
        number = 0
        for _ in range(ROUNDS):
            units = []
            for _ in range(SEVERAL):
                units.append(TIMED % (number * 0.1, 50.0 + number * 0.01))
                number += 1
            await asyncio.sleep(max(begin_s + number * 0.01 - time.monotonic(), 0.0))
            writer.write(b"".join(units))
        return number

    samples = run(seen_of(mesh, tmp_path, say))
    assert samples.count == SEVERAL * ROUNDS
    # The units of a first read may be closer, since none is stamped before those of the identity before.
    spans_ns = samples.spans_after(SEVERAL - 1)
    assert all(abs(span - 10 * MS) <= MS for span in spans_ns), sorted(spans_ns)
    # A new identity begins only at an early read: at the beginning.
    assert len(samples.spans_ns) >= SEVERAL * ROUNDS * 0.7


def test_units_of_one_read_without_time_have_the_measured_rate(mesh, tmp_path):
    arrivals_ns = []

    async def say(writer):
        begin_s, number = time.monotonic(), 0
        for _ in range(ROUNDS):
            number += SEVERAL
            await asyncio.sleep(max(begin_s + number * 0.01 - time.monotonic(), 0.0))
            writer.write(b"".join(UNIT % ((number - SEVERAL + each) * 0.1) for each in range(SEVERAL)))
            arrivals_ns.append(time.time_ns())
        return number

    samples = run(seen_of(mesh, tmp_path, say))
    (stamps,) = samples.by_identity.values()
    assert min(samples.spans_ns) > 0
    # Once a rate is measured. After a read that was late on a busy machine there is less room.
    within = [
        later - earlier
        for number in range(len(stamps) // 2, len(stamps) - 1)
        for (earlier, _), (later, _) in [stamps[number : number + 2]]
        if number % SEVERAL != SEVERAL - 1
    ]
    assert median(within) == pytest.approx(10 * MS, rel=0.5)


def test_two_positions_in_one_unit_have_two_stamps_within_a_millisecond(mesh, tmp_path):
    async def say(writer):
        for number in range(30):
            values = (number * 0.1, number * 0.1 + 0.05, 50.0 + number * 0.02)
            writer.write(b"3#ABSOLUTE.DEG*%.2f;90;-90;0;0&ABSOLUTE.DEG*%.2f;90;-90;0;0&TIME*%.2f@" % values)
            await asyncio.sleep(0.02)
        return 60

    samples = run(seen_of(mesh, tmp_path, say))
    assert min(samples.spans_ns) > 0
    assert sum(span <= MS for span in samples.spans_ns) == 30


@pytest.mark.parametrize("jump_s", [-20.0, -0.5, 3.0])
def test_setting_a_controllers_clock_begins_a_new_identity(mesh, tmp_path, jump_s):
    async def say(writer):
        for number in range(60):
            writer.write(TIMED % (number * 0.1, 50.0 + number * 0.01 + (jump_s if number >= 30 else 0.0)))
            await asyncio.sleep(0.01)
        return 60

    samples = run(seen_of(mesh, tmp_path, say))
    before, after = 29 * 0.1, 30 * 0.1
    for stamps in samples.by_identity.values():
        degrees = [position * 57.29577951308232 for _, position in stamps]
        assert not (min(degrees) < before + 0.05 < max(degrees)), "one identity on both sides of the jump"
    assert after > before
    stamps = [stamp for of_identity in samples.by_identity.values() for stamp, _ in of_identity]
    assert max(stamps) <= time.time_ns()
    assert all(span > 0 for span in samples.spans_ns)
