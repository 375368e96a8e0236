"""Limits of old client programs: slow, deaf, half-open, too many or too fast ones affect no other."""

import asyncio
import socket
from itertools import pairwise

import pytest

from protocol_gateway.unit_protocol.stream import UnitStream
from protocol_gateway.unit_server.rate_limit import Budget, Limits
from robomesh.schemas import robomesh_pb2 as schema
from tests.protocol_gateway.gateway_site import STATE, until
from tests.protocol_gateway.old_client import ME, legacy, legacy_site, program


async def test_excess_clients_are_rejected_and_affect_no_other(mesh, tmp_path):
    settings = legacy(most=2)
    simulated = {"demo": True}
    async with legacy_site(mesh, tmp_path, settings, simulated=simulated) as site, program(settings) as one:
        async with program(settings):
            await until(lambda: site.controller.legacy_clients.attached == 2)
            async with program(settings) as third:
                third.say(b"1#COMMAND*home@")
                await until(lambda: third.ended)
                assert third.bytes == b"1#ERROR*1;too many clients@"
            crowd = [await asyncio.open_connection(ME, settings.port) for _ in range(100)]
            before = len(one.positions)
            await until(lambda: site.controller.legacy_clients.turned_away == 101)
            await until(lambda: len(one.positions) > before + 50)
            for _, writer in crowd:
                writer.close()
        await until(lambda: site.controller.legacy_clients.attached == 1)
        async with program(settings) as again:
            await until(lambda: again.positions)


async def test_a_client_that_does_not_read_is_closed_and_delays_no_other(mesh, tmp_path):
    settings = legacy()
    simulated = {"demo": True, "rate_hz": 1000.0}
    async with legacy_site(mesh, tmp_path, settings, simulated=simulated) as site, program(settings) as one:
        with socket.socket() as deaf:
            deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            deaf.connect((ME, settings.port))
            await until(lambda: site.controller.legacy_clients.states_skipped > 100)
            before, skipped = len(one.units), site.controller.legacy_clients.states_skipped
            await until(lambda: site.controller.legacy_clients.closed == 1, timeout_s=20)
            gained = len(one.units) - before
            kept_from_it = site.controller.legacy_clients.states_skipped - skipped
            assert gained > 100
            assert kept_from_it > 0.5 * gained
        assert site.controller.legacy_clients.attached == 1
        assert "does not read" in (await site.event("legacy.closed", 0)).text


async def test_a_slow_reader_gets_the_newest_state(mesh, tmp_path):
    settings = legacy()
    simulated = {"demo": True, "rate_hz": 1000.0}
    async with legacy_site(mesh, tmp_path, settings, simulated=simulated) as site:
        with socket.socket() as slow:
            slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            slow.connect((ME, settings.port))
            slow.setblocking(False)
            await until(lambda: site.controller.legacy_clients.states_skipped > 500)
            loop, stream, times = asyncio.get_running_loop(), UnitStream(), []
            while not times or site.controller.controller_time_s - times[-1] > 0.3:
                for unit in stream.receive(await asyncio.wait_for(loop.sock_recv(slow, 4096), 60)):
                    times += [r.seconds for r in unit.records if hasattr(r, "seconds")]
            jumps = [later - earlier for earlier, later in pairwise(times)]
            assert min(jumps) > 0
            assert max(jumps) > 0.3


async def test_a_flooding_client_is_closed_but_its_stop_is_executed(mesh, tmp_path):
    settings = legacy(commanders={})
    simulated = {"demo": True}
    async with legacy_site(mesh, tmp_path, settings, simulated=simulated) as site, program(settings) as one:
        async with program(settings) as flood:
            flood.say(b"1#COMMAND*stop@", b"1#ABSOLUTE.DEG*1;2;3;4;5@" * 200_000)
            await until(lambda: site.events("stop.latched"))
            assert site.controller.legacy_clients.closed == 0
            before = len(one.positions)
            await until(lambda: site.controller.legacy_clients.closed == 1, timeout_s=20)
            assert site.controller.legacy_clients.units_refused < 5000
            assert len(one.positions) - before > 50
        assert "more than it may" in (await site.event("legacy.closed", 0)).text
        await until(lambda: site.controller.legacy_clients.attached == 1)


async def test_garbage_is_counted_and_answered(mesh, tmp_path):
    async with legacy_site(mesh, tmp_path, settings := legacy()) as site, program(settings) as one:
        one.say(b"\xff\x00#@", b"hello\r\n@", b"1#COMMAND*trace@")
        await until(lambda: site.controller.trace == STATE.YES)
        assert [error.number for error in one.errors] == [2, 2]
        assert site.controller.legacy_clients.units_refused == 2
        event = await site.event("legacy.malformed", 0)
        assert (event.values["offset"], event.values["bytes"]) == ("0", "\\xff\\x00#")
        one.say(b"1#COMMAND*dance@", b"1#MOOD*fine@")
        await until(lambda: len(one.errors) >= 4)
        await until(lambda: len([e for e in site.seen["audit"] if e.request == "UNIT"]) >= 4)
        entries = [e for e in site.seen["audit"] if e.request == "UNIT"]
        assert [(e.operator, e.outcome, e.values["unit"]) for e in entries] == [
            ("li", schema.AuditEntry.REFUSED, unit)
            for unit in ("\\xff\\x00#", "hello\\x0d\\x0a", "1#COMMAND*dance", "1#MOOD*fine")
        ]
        assert entries[0].text == f"Not sent: {one.errors[0].text}."


async def test_answers_to_a_vanished_client_are_not_logged(mesh, tmp_path, caplog):
    settings = legacy(commanders={})
    async with legacy_site(mesh, tmp_path, settings) as site:
        clients = lambda: site.controller.legacy_clients  # noqa: E731
        for _ in range(5):
            before = clients().units_refused
            with socket.create_connection((ME, settings.port)) as hasty:
                hasty.sendall(b"1#COMMAND*home@" * 60)
            # Bytes that were unread when the client vanished are not parsed.
            await until(lambda before=before: clients().units_refused > before and not clients().attached)
    assert "socket.send()" not in caplog.text


# -------------------------------------------------------------------------- budget


def test_a_budget_allows_a_burst_then_its_rate_and_detects_a_flood():
    limits = Limits(units_per_s=10.0, bytes_per_s=1000.0, burst_s=2.0, patience_s=5.0)
    budget = Budget(limits, 0.0)
    assert budget.spend(units=20, length=100, now_s=0.0) == 0.0
    assert budget.spend(units=10, length=50, now_s=0.0) == pytest.approx(2.0)
    assert not budget.is_flood(0.0)
    now_s = 2.0
    while not budget.is_flood(now_s):
        now_s += budget.spend(units=20, length=100, now_s=now_s)
        assert now_s < 20.0
    assert now_s >= 5.0


def test_bytes_count_like_units_and_an_allowed_rate_is_never_paused():
    budget = Budget(Limits(units_per_s=10.0, bytes_per_s=1000.0), 0.0)
    assert budget.spend(units=1, length=5000, now_s=0.0) == pytest.approx(4.0)
    budget = Budget(Limits(units_per_s=10.0, bytes_per_s=1000.0), 0.0)
    assert not any(budget.spend(units=1, length=99, now_s=0.1 * number) for number in range(10_000))


def test_an_old_excess_is_forgotten():
    budget = Budget(Limits(units_per_s=10.0), 0.0)
    assert budget.spend(units=50, length=1, now_s=0.0)
    assert budget.spend(units=50, length=1, now_s=100.0)
    assert not budget.is_flood(100.0)
