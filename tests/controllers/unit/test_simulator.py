"""Simulated controller over real sockets."""

import asyncio
import contextlib
import math
import socket
import time

import numpy as np
import pytest

from controllers.simulated.errors import SimulatorError
from controllers.simulated.faults import Span, parse_fault
from controllers.unit.simulated.service import Settings, serve
from protocol_gateway.unit_protocol.records import Error
from protocol_gateway.unit_protocol.stream import Malformed, Unit, UnitStream
from robomesh.errors import ListenError
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of
from tests.conftest import run
from tests.controllers.simulated_site import running

pytestmark = pytest.mark.slow

PT600 = load("pt600")
JOINTS = joints_of(PT600)
DEGREES = 180.0 / np.pi
TARGET = (20.0, 60.0, -40.0, 10.0, 90.0)
HOME = tuple(np.round(JOINTS.home * DEGREES, 6).tolist())


@contextlib.asynccontextmanager
async def simulator(**options):
    async with running(serve, Settings(robot="pt600", **options)) as line:
        yield int(line.removeprefix("listening on 127.0.0.1:"))


class Client:
    """A client that reads unit by unit."""

    def __init__(self, reader, writer):
        self.reader, self.writer = reader, writer
        self.stream = UnitStream()
        self.events = []

    async def next(self, wanted):
        """Return the next event that meets the predicate."""
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


async def test_states_arrive_at_the_rate_with_a_running_clock():
    begin_s = time.monotonic()
    async with simulator() as port, client(port) as one:
        first = await one.state(lambda *records: True)
        for _ in range(100):
            last = await one.state(lambda *records: True)
        assert 0.9 < last[3].seconds - first[3].seconds < time.monotonic() - begin_s


async def test_every_client_sees_the_motion_that_one_of_them_commanded():
    async with simulator() as port, client(port) as one, client(port) as two:
        one.send(b"2# COMMAND* trace; home&ABSOLUTE.DEG* 20.00; 60.00; - 40.00; 10.00; 90.00@")

        def arrived(positions, velocities, status, clock):
            return positions.values == TARGET and status.words == ("idle", "remote", "homed", "trace")

        await asyncio.gather(one.state(arrived), two.state(arrived))


async def test_a_refused_unit_is_answered_to_its_sender():
    async with simulator() as port, client(port) as one:
        one.send(b"2#COMMAND*stop@")
        assert await one.error() == Error(2, "malformed, the count says 2 records, there are 1")
        one.send(b"1#ABSOLUTE.DEG*0;0@")
        assert await one.error() == Error(4, "2 values for 5 joints")
        one.send(b"1#FORCE*1@")
        assert (await one.error()).number == 3


async def test_type_codes_are_used_in_both_directions():
    codes = {2: "ABSOLUTE.DEG", 101: "COMMAND:home"}
    async with simulator(codes=codes) as port, client(port) as one:
        unit = await one.next(lambda event: True)
        assert unit.data.startswith(b"4#2*0.00;90.00;")
        one.send(b"1#101@")
        await one.state(lambda p, v, status, t: status.words[0] == "homing")


async def test_a_client_past_the_maximum_gets_an_error_and_is_closed():
    async with simulator(max_clients=1) as port, client(port) as one:
        await one.state(lambda *records: True)
        async with client(port) as two:
            assert await two.reader.read() == b"1#ERROR*1;too many clients@"
        await one.state(lambda *records: True)


async def test_a_client_that_disconnects_makes_room_for_another():
    async with simulator(max_clients=1) as port:
        for _ in range(3):
            async with client(port) as one:
                await one.state(lambda *records: True)
            await asyncio.sleep(0.05)


@pytest.mark.slow
async def test_a_client_that_does_not_read_delays_no_other_and_is_closed():
    async with simulator(rate_hz=1000.0) as port, client(port) as quick:

        async def rate_hz(seconds):
            begin_s, count = time.monotonic(), 0
            while (took_s := time.monotonic() - begin_s) < seconds:
                await quick.state(lambda *records: True)
                count += 1
            return count / took_s

        alone_hz = await rate_hz(2.0)
        with socket.socket() as slow:
            slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            slow.connect(("127.0.0.1", port))
            # A client that does not read is closed after 5 s; until then, the other one would get nothing.
            assert await rate_hz(6.5) > 0.4 * alone_hz
            # Closed while unread data is still in its buffers.
            slow.settimeout(30.0)
            with contextlib.suppress(ConnectionError):
                while slow.recv(65536):
                    pass


async def test_clients_that_disconnect_during_a_flood_cause_no_error(caplog):
    def connect_and_disconnect(port):
        for number in range(25):
            with socket.create_connection(("127.0.0.1", port), timeout=60) as one:
                end = time.monotonic() + 0.05 + number % 7 * 0.01
                while time.monotonic() < end:
                    assert one.recv(65536)

    async with simulator(demo=True, faults=("deluge",)) as port:
        await asyncio.to_thread(connect_and_disconnect, port)
        # The last one's callbacks have run when another client gets a state.
        async with client(port) as last:
            await last.state(lambda *records: True)
    assert not [record for record in caplog.records if record.name == "asyncio"]


async def test_freeze_sends_nothing_and_keeps_the_socket_open():
    async with simulator(faults=("freeze@0.3",)) as port, client(port) as one:
        units = 0

        async def count_until_silence():
            nonlocal units
            while units < 1000:
                await asyncio.wait_for(one.next(lambda event: True), 1.5)
                units += 1

        with pytest.raises(TimeoutError):
            await count_until_silence()
        one.send(b"1#COMMAND*stop@")


async def test_garbage_is_sent_between_valid_units():
    async with simulator(faults=("garbage",), rate_hz=500.0) as port, client(port) as one:
        reasons = {(await one.next(lambda e: isinstance(e, Malformed))).reason for _ in range(20)}
        assert len(reasons) >= 8
        await one.state(lambda p, v, status, t: p.values == HOME)


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"listen": "here"}, ListenError, "HOST:PORT"),
        ({"listen": "0.0.0.0:0"}, ListenError, "--insecure"),
        ({"faults": ("melt",)}, SimulatorError, "'melt' is unknown; there are freeze, garbage"),
        ({"faults": ("freeze@soon",)}, SimulatorError, "freeze@soon"),
        ({"rate_hz": 0.0}, SimulatorError, "rate 0 Hz"),
        ({"max_clients": 0}, SimulatorError, "1 or more"),
    ],
)
def test_invalid_settings_are_refused_in_one_line(options, error, text):
    async def main():
        async with simulator(**options):
            pass

    with pytest.raises(error, match=text) as caught:
        run(main())
    assert "\n" not in str(caught.value)


async def test_a_port_in_use_is_refused_in_one_line():
    async with simulator() as port:
        with pytest.raises(ListenError, match="address already in use"):
            await serve(Settings(robot="pt600", listen=f"127.0.0.1:{port}"))


@pytest.mark.parametrize(
    ("text", "span"),
    [
        ("freeze", Span("freeze", 5.0, math.inf)),
        ("freeze@2.5", Span("freeze", 2.5, math.inf)),
        ("garbage@1+3", Span("garbage", 1.0, 3.0)),
        ("restart", Span("restart", 0.0, 1.5)),
        ("drop+2", Span("drop", 0.0, 2.0)),
    ],
)
def test_a_fault_is_parsed_with_its_begin_and_length(text, span):
    assert parse_fault(text) == span
