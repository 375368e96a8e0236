"""A gateway while the clock of its system is set."""

import time
from types import SimpleNamespace

import pytest
from google.protobuf.timestamp_pb2 import Timestamp

from protocol_gateway.execution import clocks
from robomesh.errors import RefusedError
from tests.protocol_gateway.gateway_site import LEASE_S, A, C, gateway, simulator, until

HOUR_NS = 3600 * 10**9


@pytest.fixture
def system_clock(monkeypatch):
    """Replace the wall clock of this process; the test sets it."""
    real_ns, clock = time.time_ns, SimpleNamespace(set_by_ns=0)
    monkeypatch.setattr(time, "time_ns", lambda: real_ns() + clock.set_by_ns)
    monkeypatch.setattr(time, "time", lambda: time.time_ns() * 1e-9)
    return clock


@pytest.mark.parametrize("set_by_ns", [-HOUR_NS, HOUR_NS])
async def test_no_step_of_the_systems_clock_moves_a_deadline(mesh, tmp_path, system_clock, set_by_ns):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        answer = await site.lease(A.ACQUIRE)
        gateway_minus_monotonic_ns = answer.now.ToNanoseconds() - time.monotonic_ns()

        async def speed(number, after_s):
            """Send a command with a deadline, by what the first lease answer said."""
            not_after = Timestamp()
            ns = time.monotonic_ns() + gateway_minus_monotonic_ns
            not_after.FromNanoseconds(ns + round(after_s * 1e9))
            try:
                await site.command(C.SPEED, speed_percent=50, id=number, not_after=not_after)
            except RefusedError as error:
                return error.code
            return "done"

        system_clock.set_by_ns = set_by_ns
        assert await speed(1, -0.5) == "command.late"
        assert await speed(2, 3600) == "command.deadline_far"
        assert await speed(3, 4) == "done"
        again = await site.lease(A.RENEW)
        assert 0 < again.until.ToNanoseconds() - again.now.ToNanoseconds() <= LEASE_S * 1e9
        assert 0 < again.now.ToNanoseconds() - answer.now.ToNanoseconds() < 60 * 10**9
        # The page compares them: a lease published later is later.
        await until(lambda: site.seen["lease"][-1].timestamp.ToNanoseconds() > again.now.ToNanoseconds())
        published = site.seen["lease"][-1].timestamp.ToNanoseconds()
        assert published - again.now.ToNanoseconds() < 60 * 10**9
        # People read the system's clock in the audit log.
        entry = site.seen["audit"][-1]
        assert abs(entry.timestamp.ToNanoseconds() - time.time_ns()) < 60 * 10**9


def test_the_gateways_time_begins_with_the_wall_clock_and_never_steps(system_clock):
    clocks._start_ns.cache_clear()
    system_clock.set_by_ns = HOUR_NS
    before, wall_ns = clocks.read_clocks(), time.time_ns()
    assert abs(before.gateway_ns - wall_ns) < 10**9
    for set_by_ns in (-HOUR_NS, 0, 5 * HOUR_NS):
        system_clock.set_by_ns = set_by_ns
        after = clocks.read_clocks()
        passed_ns = round((after.monotonic_s - before.monotonic_s) * 1e9)
        assert abs(after.gateway_ns - before.gateway_ns - passed_ns) < 1000
        assert abs(after.wall_ns - time.time_ns()) < 10**9
    clocks._start_ns.cache_clear()
