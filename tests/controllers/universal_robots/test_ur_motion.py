"""Motion of a robot of Universal Robots: gateway and simulated controller over real sockets."""

import asyncio
import math
import re
import time

import pytest

from controllers.universal_robots import motion_script
from protocol_gateway.checking.checker import Checker
from robomesh.errors import RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from tests.controllers.simulated_site import move
from tests.controllers.universal_robots.ur_site import UR, controller, in_control, movable, others, runs
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, moving, refusal, resting, until
from tests.protocol_gateway.test_program_runs import ended, start
from tests.protocol_gateway.wire import wire

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def patient_watchdog(monkeypatch):
    """Let a busy machine be late: gateway and controller share one event loop here."""
    monkeypatch.setattr(motion_script, "WATCHDOG_HZ", 1)


def positions(server):
    return server.controller.programs.arm(time.monotonic()).positions


async def test_targets_are_absolute_and_programs_hold_numbers_only(mesh, tmp_path, monkeypatch):
    async with (
        controller(monkeypatch) as (ports, server),
        wire(ports.scripts[0]) as gate,
        movable(mesh, tmp_path, ports, ports={**others(ports), "scripts": gate.port}) as site,
    ):
        await in_control(site)
        assert site.controller.homed == STATE.YES
        before = positions(server)
        await site.command(C.SPEED, speed_percent=50)
        target = await move(site, 0.2)
        await moving(site)
        await resting(site)
        assert positions(server) == pytest.approx(target, abs=1e-6)
        await site.command(C.MOVE_RELATIVE, joint_positions=[-0.2, 0.1, 0, 0, 0, 0])
        await moving(site)
        await resting(site)
        assert positions(server)[0] == pytest.approx(before[0], abs=1e-5)
        assert positions(server)[1] == pytest.approx(before[1] + 0.1, abs=1e-5)
        assert not runs(server)
        sent = gate.data.decode()
        assert sent.count("def robomesh_motion():") == sent.count("movej(") == 2
        assert all("v=0.523599" in line for line in sent.splitlines() if "movej" in line)
        # Nothing but the two motions' programs, which differ in their numbers only.
        shapes = {re.sub(r"-?\d+(\.\d+)?", "0", text) for text in sent.split("def ")[1:]}
        assert len(shapes) == 1
        assert "homed" in await refusal(site.command(C.HOME))
        assert "no HOLD" in await refusal(site.command(C.HOLD))


async def test_a_program_makes_one_motion_after_the_other(mesh, tmp_path, monkeypatch):
    text = "speed 100\nmove_joints 3 -90 180 0 45 0\nmove_joints 0 -90 180 0 48 0\n"
    async with (
        controller(monkeypatch) as (ports, server),
        wire(ports.scripts[0]) as gate,
        movable(mesh, tmp_path, ports, ports={**others(ports), "scripts": gate.port}) as site,
    ):
        await in_control(site)
        start_at = positions(server)
        await start(site, text)
        await ended(site, schema.ProgramState.DONE)
        assert gate.data.count(b"movej(") == 2
        assert positions(server)[4] == pytest.approx(start_at[4] + math.radians(3), abs=1e-3)
        assert not site.controller.HasField("stop")


async def test_a_changed_payload_is_confirmed_with_a_reason_by_an_operator_who_has_looked(
    mesh, tmp_path, monkeypatch
):
    # Nothing is checked here: no process is needed.
    monkeypatch.setattr(Checker, "problem", lambda self, robot: None)

    def confirmation(**fields):
        given = {"recovery": schema.Recover.CONFIRM_TOOL, "reason": "new gripper", "looked": True} | fields
        return {"recover": schema.Recover(**given)}

    async with (
        controller(monkeypatch) as (ports, server),
        movable(mesh, tmp_path, ports, check="require") as site,
    ):
        await in_control(site)
        assert "nothing to confirm" in await refusal(site.command(C.RECOVER, **confirmation()))
        server.controller.payload_kg = 4.0
        await until(lambda: "payload.mass" in site.controller.check_text)
        assert schema.Recover.CONFIRM_TOOL in site.controller.capabilities.recoveries
        await site.lease(A.RENEW)
        for wrong in ({"reason": ""}, {"looked": False}):
            assert "Not sent" in await refusal(site.command(C.RECOVER, **confirmation(**wrong)))
        async with asyncio.timeout(30.0):
            # The arm must be seen to rest.
            while "moves" in await answer_of(site.command(C.RECOVER, **confirmation())):
                await site.lease(A.RENEW)
        await until(lambda: not site.controller.check_text)
        event = await site.event("recover.confirmed", -1)
        assert re.fullmatch(r"li has confirmed payload.mass .* → 4: new gripper", event.text)


async def answer_of(asked):
    try:
        return (await asked).text
    except RefusedError as error:
        return str(error)


@pytest.mark.parametrize("version", [(3, 15, 0, 0), (5, 5, 0, 0), (10, 7, 0, 0)])
async def test_other_software_is_refused(mesh, tmp_path, monkeypatch, version):
    async with (
        controller(monkeypatch, version=version) as (ports, server),
        movable(mesh, tmp_path, ports, accept_unknown=frozenset({"mode"})) as site,
    ):
        await until(lambda: site.joints)
        await until(lambda: site.controller.read_only)
        can = site.controller.capabilities
        assert (can.stops, [*can.commands], [*can.recoveries]) == (can.NONE, [], [])
        assert "PolyScope 5.6" in await refusal(site.lease(A.ACQUIRE))
        # The dashboard is given back, and a connection for inputs is not opened.
        await until(lambda: not server._dashboards)
        await site.units(50)
        assert (len(server.rtde_clients), len(server._dashboards)) == (1, 0)
        assert not server.controller.registers.inputs
        assert not runs(server)


async def test_without_motion_in_the_site_file_no_other_connection_is_opened(mesh, tmp_path, monkeypatch):
    async with (
        controller(monkeypatch, demo=True) as (ports, server),
        wire(ports.rtde) as gate,
        gateway(mesh, tmp_path, gate.port, **UR, ports=others(ports)) as site,
    ):
        await until(lambda: site.joints)
        greeting = gate.data
        answer = await site.stop(by="wang")
        assert not answer.sent
        await site.units(100)
        assert gate.data == greeting
        assert not server._dashboards
        assert len(server._monitors) == 1
        assert "does not let the gateway move it" in await refusal(site.lease(A.ACQUIRE))
