"""Gateway with frozen and dead controllers, without its router, and with an internal failure."""

import asyncio
import contextlib
import os
import signal
import sys
from pathlib import Path

import pytest
import zenoh

from protocol_gateway.audit.log import read_entries
from protocol_gateway.robot.robot import Robot
from robomesh.contract.endpoints import router_config
from robomesh.wire.session import SessionSettings
from tests.conftest import last_value
from tests.ports import free_port
from tests.protocol_gateway.gateway_site import PROMPT, STATE, A, C, gateway, refusal, simulator, until

FAR = [2.4, 0.2, -0.2, 0.1, 0.5]
HOUSE = Path(__file__).resolve().parents[2]
SIMULATOR = """
import asyncio
from controllers.unit.simulated.service import Settings, serve
asyncio.run(serve(Settings(robot="pt600", demo=True), ready=lambda line: print(line, flush=True)))
"""


@contextlib.asynccontextmanager
async def simulator_process():
    """Run a simulated controller in a separate process; yield its port."""
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-c",
        SIMULATOR,
        cwd=HOUSE,
        env={**os.environ, "PYTHONPATH": str(HOUSE)},
        stdout=asyncio.subprocess.PIPE,
    )
    try:
        line = await process.stdout.readline()
        yield process, int(line.rpartition(b":")[2])
    finally:
        process.send_signal(signal.SIGCONT)
        process.kill()
        await process.wait()


async def test_a_frozen_controller_is_silent_and_old_states_keep_their_stamps(mesh, tmp_path):
    async with simulator_process() as (process, port), gateway(mesh, tmp_path, port, **PROMPT) as site:
        process.send_signal(signal.SIGSTOP)
        await until(lambda: site.controller.link == STATE.SILENT)
        count, last = len(site.seen["joints"]), site.seen["joints"][-1]
        await site.lease(A.ACQUIRE)
        assert "silent" in await refusal(site.command(C.HOME))
        await until(lambda: site.controller.last_unit_age_s > 2.0)
        assert len(site.seen["joints"]) == count
        assert site.seen["joints"][-1].timestamp == last.timestamp
        process.send_signal(signal.SIGCONT)
        await until(lambda: site.controller.link == STATE.UP)


async def test_a_stop_while_the_link_is_down_is_latched_and_sent_when_it_is_back(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        pass
    async with gateway(mesh, tmp_path, port, up=False) as site:
        await until(lambda: site.controller.link_text.startswith("cannot connect"))
        assert site.controller.mode == STATE.MODE_UNKNOWN
        stop = await site.stop(reason="try")
        assert not stop.sent
        assert "connection refused; it is sent as soon as the link is back" in stop.text
        await site.lease(A.ACQUIRE)
        assert "the link to the controller is down" in await refusal(site.command(C.TRACE_ON))
        assert site.controller.stop.sent is False
        async with simulator(listen=f"127.0.0.1:{port}"):
            await until(lambda: site.controller.activity == STATE.STOPPED)
            assert site.controller.stop.sent is True


@pytest.mark.slow
async def test_without_its_router_the_gateway_stops_motion_of_a_lost_operator(tmp_path):
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    mesh = SessionSettings(connect=(endpoint,), wait_s=5.0)
    router = zenoh.open(router_config((endpoint,)))
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        await site.lease(A.RENEW, ttl_s=1)
        await site.command(C.MOVE_ABSOLUTE, joint_positions=FAR)
        await asyncio.to_thread(router.close)
        await until(lambda: [e.request for e in read_entries(site.audit)][-2:] == ["STOP", "EXPIRE"])
        router = await asyncio.to_thread(zenoh.open, router_config((endpoint,)))
        await until(lambda: site.controller.activity == STATE.STOPPED, timeout_s=40.0)
        await asyncio.to_thread(router.close)


async def test_a_dead_controller_does_not_affect_another_robot(mesh, tmp_path):
    async with simulator(demo=True) as alive, gateway(mesh, tmp_path, alive, free_port()) as site:
        other = await last_value(site.session, "robomesh/hall/arm-2/controller")
        assert other.link == STATE.DOWN
        await until(lambda: len(site.seen["joints"]) > 100)
        assert site.controller.counters.connections == 1


async def test_a_failure_at_one_robot_is_reported_and_its_task_restarts(mesh, tmp_path, monkeypatch):
    failing = True
    observe = Robot._observe

    def sometimes(robot):
        if failing and robot._settings.name == "arm":
            raise ZeroDivisionError
        observe(robot)

    async with (
        simulator(demo=True) as one,
        simulator(demo=True) as two,
        gateway(mesh, tmp_path, one, two) as site,
    ):
        monkeypatch.setattr(Robot, "_observe", sometimes)
        await until(lambda: site.events("gateway.failed"))
        other = site.session.subscribe("robomesh/hall/arm-2/joints")
        for _ in range(20):
            await anext(other)
        failing = False
        states = len(site.seen["controller"])
        await until(lambda: len(site.seen["controller"]) > states)
        await site.lease(A.ACQUIRE)
