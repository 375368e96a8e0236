"""Recoveries of a robot of Universal Robots: gateway and simulated controller over real sockets."""

import time
from contextlib import asynccontextmanager

import pytest

from controllers.universal_robots import motion_driver
from controllers.universal_robots.interfaces.modes import RobotMode, RuntimeState, SafetyMode
from controllers.universal_robots.simulated import controller as simulated
from protocol_gateway.audit.log import read_entries
from protocol_gateway.authority.audit_entry import Outcome
from protocol_gateway.seam import Recovery
from protocol_gateway.seam.errors import GatewaySettingsError
from robomesh.errors import RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from tests.controllers.simulated_site import move
from tests.controllers.universal_robots.ur_site import controller, in_control, movable, others, runs
from tests.protocol_gateway.gateway_site import STATE, A, C, until
from tests.protocol_gateway.wire import wire

pytestmark = pytest.mark.slow

R = schema.Recover
ALLOWED = frozenset({Recovery.UNLOCK_PROTECTIVE_STOP, Recovery.POWER_ON, Recovery.BRAKE_RELEASE})


@asynccontextmanager
async def recoverable(mesh, folder, monkeypatch):
    """Run a site that allows recoveries; yield it, the controller, and the wire of the dashboard."""
    async with (
        controller(monkeypatch) as (ports, server),
        wire(ports.dashboard) as gate,
        movable(
            mesh, folder, ports, ports={**others(ports), "dashboard": gate.port}, recover=ALLOWED
        ) as site,
    ):
        await in_control(site)
        yield site, server, gate


def recover(site, recovery, reason="the gripper hit the fixture", looked=True, **fields):
    message = R(recovery=recovery, reason=reason, looked=looked)
    return site.command(C.RECOVER, recover=message, **fields)


async def refused(awaitable):
    """Return the code of a refusal."""
    with pytest.raises(RefusedError) as caught:
        await awaitable
    return caught.value.code


async def in_state(site, activity):
    await until(lambda: site.controller.activity == activity)
    await site.lease(A.RENEW)


def said(gate):
    return [each for each in gate.data.decode().splitlines() if each != "is in remote control"]


async def test_a_protective_stop_is_unlocked_once_and_nothing_else_changes(mesh, tmp_path, monkeypatch):
    monkeypatch.setattr(motion_driver, "UNLOCK_AFTER_S", 0.5)
    monkeypatch.setattr(simulated, "_UNLOCK_AFTER_S", 0.5)
    async with recoverable(mesh, tmp_path, monkeypatch) as (site, server, gate):
        capabilities = site.controller.capabilities
        assert C.RECOVER in capabilities.commands
        # And a changed tool can be confirmed, which sends nothing.
        assert set(capabilities.recoveries) - {R.CONFIRM_TOOL} == {
            R.UNLOCK_PROTECTIVE_STOP,
            R.POWER_ON,
            R.BRAKE_RELEASE,
        }
        # A motion is under way, and a program of the gateway runs, until the controller stops it.
        await move(site, 2.0)
        await until(lambda: server.controller.programs.moving(time.monotonic()))
        assert await refused(recover(site, R.UNLOCK_PROTECTIVE_STOP)) == "recover.moves"
        server.controller.protective_stop(time.monotonic())
        await until(lambda: site.controller.HasField("stop"))
        await until(lambda: not runs(server))
        await in_state(site, STATE.STOPPED)
        begin_s = time.monotonic()
        event = await site.event("controller.stopped", 0)
        assert (event.severity, event.reason.code) == (event.WARNING, "controller.stopped_itself")
        await until(lambda: not server.controller.programs.moving(time.monotonic()))
        assert await refused(recover(site, R.RESTART_SAFETY)) == "recover.not_allowed"
        assert await refused(recover(site, R.SERVO_ON)) == "recover.not_there"
        assert await refused(recover(site, R.UNLOCK_PROTECTIVE_STOP, reason=" \n")) == "recover.reason"
        assert await refused(recover(site, R.UNLOCK_PROTECTIVE_STOP, looked=False)) == "recover.looked"
        assert await refused(recover(site, R.POWER_ON)) == "universal_robots.recovery_not_now"
        assert await refused(recover(site, R.UNLOCK_PROTECTIVE_STOP, operator="wang")) == "lease.held"
        assert await refused(recover(site, R.UNLOCK_PROTECTIVE_STOP, lease="guessed")) != ""
        # A RESET clears the gateway's latch, and a RESUME is refused: neither recovers the controller.
        await site.command(C.RESET, stop_id=site.controller.stop.id)
        assert await refused(site.command(C.RESUME)) == "command.not_there"
        answer = await site.stop(by="wang")
        assert set(said(gate)) == {"stop"}
        await until(lambda: time.monotonic() > begin_s + 0.7)
        await site.lease(A.RENEW)
        rest = server.controller.programs.arm(time.monotonic()).positions
        text = (await recover(site, R.UNLOCK_PROTECTIVE_STOP)).text
        assert text.startswith("unlock_protective_stop is on the controller's socket; the robot's state")
        sent, answered = await site.event("recover.sent", -1), await site.event("recover.answered", -1)
        assert "the gripper hit the fixture" in sent.text
        assert '"Protective stop releasing"' in answered.text
        await in_state(site, STATE.IDLE)
        assert [each for each in said(gate) if each != "stop"] == ["unlock protective stop"]
        # The gateway's stop stays latched, and no program runs.
        assert site.controller.stop.id == answer.stop_id
        assert await refused(move(site, 0.1)) == "stop.latched"
        assert server.controller.programs.state is RuntimeState.STOPPED
        assert list(server.controller.programs.arm(time.monotonic()).positions) == list(rest)
        entries = [each for each in read_entries(site.audit) if each.request == "RECOVER"]
        entries = [each for each in entries if each.outcome is Outcome.ACCEPTED]
        # The driver, which sees the controller's state, refused the first after its entry.
        assert [each.values["recovery"] for each in entries] == ["power_on", "unlock_protective_stop"]
        assert entries[-1].values["reason"] == "the gripper hit the fixture"
        assert entries[-1].values["looked"] == "yes"
        await site.command(C.RESET, stop_id=answer.stop_id)
        await move(site, 0.1)
        await in_state(site, STATE.MOVING)


async def test_an_arm_without_power_gets_it_and_its_brakes_are_released_one_by_one(
    mesh, tmp_path, monkeypatch
):
    async with recoverable(mesh, tmp_path, monkeypatch) as (site, server, gate):
        assert await refused(recover(site, R.POWER_ON)) == "universal_robots.recovery_not_now"
        server.controller.power_off(time.monotonic())
        await in_state(site, STATE.STOPPED)
        # A controller would power the arm on, too.
        assert await refused(recover(site, R.BRAKE_RELEASE)) == "universal_robots.recovery_not_now"
        await recover(site, R.POWER_ON)
        await until(lambda: server.controller.robot_mode is RobotMode.IDLE)

        # The gateway sees the new mode a state later.
        await site.units(3)
        await site.lease(A.RENEW)
        await recover(site, R.BRAKE_RELEASE)
        await in_state(site, STATE.IDLE)
        assert said(gate) == ["power on", "brake release"]
        await move(site, 0.1)
        await in_state(site, STATE.MOVING)


async def test_a_program_of_others_must_end_first(mesh, tmp_path, monkeypatch):
    """It would wait for Play: after the protective stop it could go on."""
    monkeypatch.setattr(motion_driver, "UNLOCK_AFTER_S", 0.0)
    async with (
        controller(monkeypatch, demo=True) as (ports, server),
        movable(mesh, tmp_path, ports, recover=ALLOWED) as site,
    ):
        server.controller.protective_stop(time.monotonic())
        await in_control(site)
        await in_state(site, STATE.STOPPED)
        await until(lambda: site.joints)
        await until(lambda: server.controller.runtime_state is RuntimeState.PAUSED)

        async def code():
            return await refused(recover(site, R.UNLOCK_PROTECTIVE_STOP))

        # Until the arm is seen to rest.
        while (found := await code()) == "recover.moves":
            await site.lease(A.RENEW)
        assert found == "universal_robots.other_program"
        assert server.controller.safety_mode is SafetyMode.PROTECTIVE_STOP


async def test_a_recovery_that_the_driver_does_not_have_is_named_at_the_start(mesh, tmp_path, monkeypatch):
    async with controller(monkeypatch) as (ports, _):
        with pytest.raises(
            GatewaySettingsError,
            match="recover 'servo_on': this robot has 'brake_release', 'close_safety_popup', 'power_on'",
        ):
            async with movable(mesh, tmp_path, ports, recover=frozenset({Recovery.SERVO_ON})):
                pass
        with pytest.raises(GatewaySettingsError, match="recover 'power_on': this robot has no recoveries"):
            async with movable(mesh, tmp_path, ports, recover=frozenset({Recovery.POWER_ON}), options=None):
                pass
