"""Operators that vanish and links that break: the arm stops."""

import asyncio
import contextlib
import signal
import sys

import pytest

from protocol_gateway.audit.log import read_entries
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, simulator, until

FAR = [2.4, 1.0, 0.5, -1.0, 2.0]


@contextlib.asynccontextmanager
async def homing(site, mesh):
    """Run `robomesh send arm home` in a separate process, and wait until the arm homes."""
    site.own.declare_presence("hall", "arm", "gateway")  # the service does the same at its start
    process = await asyncio.create_subprocess_exec(
        *[sys.executable, "-m", "services.command_line.main", "send", "arm", "home"],
        *["--connect", mesh.connect[0], "--operator", "wang"],
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.DEVNULL,
    )
    try:
        await until(lambda: site.controller.activity == STATE.HOMING)
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.wait()


async def test_a_killed_program_loses_control_with_its_session(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        async with homing(site, mesh) as process:
            process.send_signal(signal.SIGKILL)
            await until(lambda: site.controller.HasField("stop"))
        assert site.controller.stop.reason == "dead-man: wang's page or program has disconnected"
        await until(lambda: site.controller.activity == STATE.STOPPED)
        assert site.controller.homed == STATE.NO
        await until(lambda: site.seen["lease"][-1].ended == "wang's page or program has disconnected")
        await until(lambda: any(entry.request == "REVOKE" for entry in read_entries(site.audit)))
        entries = {entry.request: entry for entry in read_entries(site.audit)}
        # The lease did not expire: it was ended.
        assert entries["REVOKE"].text == "wang's page or program has disconnected"
        assert "EXPIRE" not in entries


async def test_a_hanging_program_loses_control_when_its_lease_expires(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        await site.command(C.MOVE_ABSOLUTE, joint_positions=[0.3, 0, 0, 0, 0])
        await until(lambda: site.joints[0] == pytest.approx(0.3, abs=1e-3))
        await until(lambda: not site.seen["lease"][-1].motion)
        await site.command(C.SPEED, speed_percent=1)  # the way home takes longer than the lease lives
        await site.lease(A.RELEASE)
        async with homing(site, mesh) as process:
            process.send_signal(signal.SIGSTOP)
            await until(lambda: site.controller.HasField("stop"))
        # 5 s, if it was stopped before its first renewal; then its silent connection may be closed first.
        reasons = [f"dead-man: wang's lease was not renewed within {ttl} s" for ttl in (2, 5)]
        reasons.append("dead-man: wang's page or program has disconnected")
        assert site.controller.stop.reason in reasons


async def test_a_link_lost_during_motion_is_a_stop_sent_after_reconnection(mesh, tmp_path):
    async with contextlib.AsyncExitStack() as stack:
        first = await stack.enter_async_context(contextlib.AsyncExitStack())
        port = await first.enter_async_context(simulator())
        site = await stack.enter_async_context(gateway(mesh, tmp_path, port))
        await site.home()
        await site.command(C.MOVE_ABSOLUTE, joint_positions=FAR)
        await until(lambda: site.controller.activity == STATE.MOVING)
        await first.aclose()  # the controller dies
        await until(lambda: site.controller.HasField("stop"))
        stop = site.controller.stop
        assert not stop.sent
        assert stop.reason.startswith("the link was lost during a motion of li: ")
        await stack.enter_async_context(simulator(listen=f"127.0.0.1:{port}"))
        await until(lambda: site.controller.activity == STATE.STOPPED)
        assert site.controller.stop.sent


async def test_a_link_lost_at_rest_keeps_the_lease(mesh, tmp_path):
    async with contextlib.AsyncExitStack() as stack:
        first = await stack.enter_async_context(contextlib.AsyncExitStack())
        port = await first.enter_async_context(simulator())
        site = await stack.enter_async_context(gateway(mesh, tmp_path, port))
        await site.lease(A.ACQUIRE)
        await first.aclose()
        await until(lambda: site.controller.link == STATE.DOWN)
        await stack.enter_async_context(simulator(listen=f"127.0.0.1:{port}"))
        await until(lambda: site.controller.link == STATE.UP)
        assert not site.controller.HasField("stop")
        await site.lease(A.RENEW)
