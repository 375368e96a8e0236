"""No joints message carries a newer time than its unit, with any delay on the way."""

import asyncio
import contextlib
import math
import time

import pytest

from tests.protocol_gateway.gateway_site import gateway, until

# Delay between a unit's writing and its reading on a busy machine.
_SLACK_S = 0.35
# A unit's number travels in its first joint, in steps that the protocol's text carries exactly.
_STEP_DEG = 0.01


class Clocked:
    """Controller that sends its TIME, and records when each unit was created and written."""

    def __init__(self, way):
        self._way = way
        self.made_ns, self.written_ns = [], []

    async def serve(self, reader, writer):
        try:
            with contextlib.suppress(ConnectionError):
                await self._way(self, reader, writer)
        finally:
            writer.transport.abort()

    def unit(self):
        number = len(self.made_ns)
        self.made_ns.append(time.time_ns())
        self.written_ns.append(0)
        return number, b"2#ABSOLUTE.DEG*%.2f;90;-90;0;0&TIME*%.6f@" % (
            (number % 9000) * _STEP_DEG,
            time.monotonic(),
        )

    def wrote(self, *numbers):
        for number in numbers:
            self.written_ns[number] = time.time_ns()


async def steady(controller, writer, count):
    for _ in range(count):
        number, unit = controller.unit()
        writer.write(unit)
        controller.wrote(number)
        await asyncio.sleep(0.01)


async def split(controller, writer):
    for _ in range(100):
        number, unit = controller.unit()
        for begin in range(0, len(unit), 7):
            writer.write(unit[begin : begin + 7])
            controller.wrote(number)
            await asyncio.sleep(0.002)


async def burst(controller, writer):
    await steady(controller, writer, 50)
    for _ in range(2):
        held = []
        for _ in range(150):
            held.append(controller.unit())
            await asyncio.sleep(0.01)
        writer.write(b"".join(unit for _, unit in held))
        controller.wrote(*(number for number, _ in held))
        await steady(controller, writer, 30)


async def freeze(controller, writer):
    await steady(controller, writer, 50)
    await asyncio.sleep(1.5)
    await steady(controller, writer, 50)


async def flood(controller, writer):
    for _ in range(100):
        units = [controller.unit() for _ in range(60)]
        writer.write(b"".join(unit for _, unit in units))
        controller.wrote(*(number for number, _ in units))
        await writer.drain()
        await asyncio.sleep(0.01)


@pytest.mark.parametrize("way", [split, burst, freeze, flood])
async def test_no_joints_message_is_stamped_newer_than_its_unit(mesh, tmp_path, way):
    done = asyncio.Event()

    async def whole_way(controller, reader, writer):
        await way(controller, writer)
        done.set()
        with contextlib.suppress(ConnectionError):
            await reader.read()

    controller = Clocked(whole_way)
    server = await asyncio.start_server(controller.serve, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    patient = {"stale_after_s": 5.0, "reconnect_after_s": 20.0}
    async with server, gateway(mesh, tmp_path, port, up=False, **patient) as site:
        await done.wait()
        await until(lambda: number_of(site.seen["joints"][-1]) == (len(controller.made_ns) - 1) % 9000)
        seen = [(number_of(each), each.timestamp.ToNanoseconds()) for each in site.seen["joints"]]
    assert len(seen) >= 50
    late_ns = [stamp_ns - controller.made_ns[number] for number, stamp_ns in seen]
    if way is split:
        # A unit is received with its last byte: creation and end of writing are 30 ms apart.
        late_ns = [stamp_ns - controller.written_ns[number] for number, stamp_ns in seen]
    assert max(late_ns) < _SLACK_S * 1e9
    # Delayed units are stamped by the controller's clock.
    assert all(stamp_ns >= controller.made_ns[number] - 1e6 for number, stamp_ns in seen)


def number_of(joints):
    return round(math.degrees(joints.joints[0].position) / _STEP_DEG)
