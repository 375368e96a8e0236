"""Motion of a robot of Universal Robots: gateway and simulated controller over real sockets."""

import asyncio
import contextlib
import math
import re
import signal
import sys
import time

import pytest

from protocol_gateway.drivers.universal_robots import motion_script
from protocol_gateway.drivers.universal_robots.modes import RuntimeState
from robomesh.errors import RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from tests.conftest import run
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, refusal, until
from tests.protocol_gateway.test_program_runs import ended, start
from tests.protocol_gateway.ur_site import UR, controller, in_control, movable, move, others, runs
from tests.protocol_gateway.wire import wire

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def patient_watchdog(monkeypatch):
    """Let a busy machine be late: gateway and controller share one event loop here."""
    monkeypatch.setattr(motion_script, "WATCHDOG_HZ", 1)


def moving(site):
    return until(lambda: site.controller.activity == STATE.MOVING)


def resting(site):
    return until(lambda: site.controller.activity == STATE.IDLE)


def positions(server):
    return server.controller.programs.arm(time.monotonic()).positions


async def stopped_for(site, code):
    """Wait until the gateway has latched a stop for a reason; return the stop."""
    await until(lambda: site.controller.HasField("stop"))
    stop = site.controller.stop
    assert stop.why.code == "stop.fate_unknown", stop
    assert code in [each.code for each in _causes(stop.why)], stop
    return stop


def _causes(reason):
    yield reason
    for cause in reason.causes:
        yield from _causes(cause)


async def reset(site):
    await until(lambda: site.controller.activity == STATE.IDLE)
    await site.command(C.RESET, stop_id=site.controller.stop.id)


def test_targets_are_absolute_and_programs_hold_numbers_only(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch) as (ports, server),
            wire(ports.scripts) as gate,
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

    run(main())


def test_a_program_makes_one_motion_after_the_other(mesh, tmp_path, monkeypatch):
    text = "speed 100\nrepeat 2\n  move_joints 10 -90 180 0 45 0\n  move_joints 0 -90 180 0 55 0\nend\n"

    async def main():
        async with (
            controller(monkeypatch) as (ports, server),
            wire(ports.scripts) as gate,
            movable(mesh, tmp_path, ports, ports={**others(ports), "scripts": gate.port}) as site,
        ):
            await in_control(site)
            start_at = positions(server)
            await start(site, text)
            await ended(site, schema.ProgramState.DONE)
            assert gate.data.count(b"movej(") == 4
            assert positions(server)[4] == pytest.approx(start_at[4] + math.radians(10), abs=1e-3)
            assert not site.controller.HasField("stop")

    run(main(), timeout_s=120.0)


def test_a_stop_ends_the_motion_and_a_reset_sends_nothing(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch) as (ports, server),
            wire(ports.dashboard) as gate,
            movable(mesh, tmp_path, ports, ports={**others(ports), "dashboard": gate.port}) as site,
        ):
            await in_control(site)
            target = await move(site, 2.0)
            await until(lambda: server.controller.programs.moving(time.monotonic()))
            answer = await site.stop(by="wang")
            assert answer.sent
            await until(lambda: not runs(server))
            assert abs(positions(server)[0] - target[0]) > 0.5
            assert b"stop\n" in gate.data
            assert "stop 1 is latched" in await refusal(move(site, 0.1))
            await reset(site)
            commands = set(gate.data.decode().splitlines())
            assert commands == {"is in remote control", "stop"}
            rest = positions(server)
            await asyncio.sleep(0.2)
            assert positions(server) == pytest.approx(rest)
            await move(site, -0.2)
            await moving(site)
            await resting(site)
            assert positions(server)[0] == pytest.approx(rest[0] - 0.2, abs=1e-5)

    run(main())


def test_nothing_is_sent_while_another_program_runs(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch, demo=True) as (ports, server),
            wire(ports.scripts) as gate,
            movable(mesh, tmp_path, ports, ports={**others(ports), "scripts": gate.port}) as site,
        ):
            await in_control(site)
            await moving(site)
            assert "another program" in await refusal(move(site, 0.1))
            # Also one that is paused, or that begins under the operator's control.
            server.controller.programs.pause(time.monotonic())
            await until(lambda: site.controller.activity == STATE.HOLDING)
            assert "hold" in (await refusal(move(site, 0.1))).lower()
            server.controller.programs.stop(time.monotonic())
            await resting(site)
            await move(site, 0.05)
            await moving(site)
            await resting(site)
            programs = gate.data.count(b"def ")
            server.controller.programs.play(time.monotonic())
            await until(lambda: site.events("motion.foreign"))
            await until(lambda: site.seen["lease"][-1].holder == "")
            assert gate.data.count(b"def ") == programs == 1

    run(main())


def test_a_motion_that_does_not_start_latches_a_stop_and_cannot_start_later(mesh, tmp_path, monkeypatch):
    async def main():
        async with controller(monkeypatch) as (ports, server), movable(mesh, tmp_path, ports) as site:
            await in_control(site)
            held_back = []
            take = server.controller.take_script
            monkeypatch.setattr(server.controller, "take_script", lambda *given: held_back.append(given[0]))
            await move(site, 0.5)
            await stopped_for(site, "universal_robots.not_started")
            assert len(held_back) == 1
            rest = positions(server)
            take(held_back[0], time.monotonic())
            await until(lambda: server.controller.registers.outputs)
            await until(lambda: not runs(server))
            assert positions(server) == pytest.approx(rest)
            progress = server.controller.registers.outputs["output_int_register_25"]
            assert progress == motion_script.Progress.NOT_BEGUN
            assert len(held_back) == 1

    run(main())


async def replaced(ports, server, site):
    """Let another client start a program."""
    _, writer = await asyncio.open_connection("127.0.0.1", ports.scripts)
    writer.write(b"def other():\n  while True:\n    sync()\n  end\nend\n")
    await writer.drain()
    await until(lambda: site.controller.HasField("stop"))
    writer.close()


async def went_local(ports, server, site):
    server.controller.remote = False
    for monitor in tuple(server._monitors):
        monitor.lose_control()


async def stopped_by_safety(ports, server, site):
    server.controller.protective_stop(time.monotonic())


async def paused(ports, server, site):
    server.controller.programs.pause(time.monotonic())


async def other_tool(ports, server, site):
    server.controller.take_script("sec tool():\n  set_tcp(p[0,0,0.3,0,0,0])\nend", time.monotonic())


async def other_payload(ports, server, site):
    server.controller.payload_kg = 4.0


@pytest.mark.parametrize(
    ("happens", "code"),
    [
        (replaced, "universal_robots.lost_program"),
        (went_local, "universal_robots.went_local"),
        (stopped_by_safety, "universal_robots.arm_stopped"),
        (paused, "universal_robots.paused"),
        (other_tool, "universal_robots.tool_changed"),
        (other_payload, "universal_robots.tool_changed"),
    ],
)
def test_what_others_do_during_a_motion_latches_a_stop(mesh, tmp_path, monkeypatch, happens, code):
    async def main():
        async with controller(monkeypatch) as (ports, server), movable(mesh, tmp_path, ports) as site:
            await in_control(site)
            target = await move(site, 2.5)
            await until(lambda: server.controller.programs.moving(time.monotonic()))
            await happens(ports, server, site)
            await stopped_for(site, code)
            await until(lambda: not server.controller.programs.moving(time.monotonic()))
            assert abs(positions(server)[0] - target[0]) > 0.3
            # Whatever ends the obstacle, the motion does not go on.
            rest = positions(server)
            server.controller.end_protective_stop(time.monotonic())
            server.controller.remote = True
            server.controller.programs.play(time.monotonic())
            await until(lambda: server.controller.programs.state is RuntimeState.STOPPED)
            assert abs(positions(server)[0] - rest[0]) < 0.05
            await until(lambda: site.controller.mode == STATE.REMOTE)
            await site.lease(A.RENEW, ttl_s=5)
            await reset(site)
            # The connections from before a change of the mode take no program: they were opened again.
            await until_it_moves(site, server)

    run(main())


def test_motions_are_unchecked_after_a_change_of_the_payload_until_it_is_undone_or_confirmed(
    mesh, tmp_path, monkeypatch
):
    """What the arm carries is not what its check knows: with "require" nothing moves."""

    def confirmation(**fields):
        given = {"recovery": schema.Recover.CONFIRM_TOOL, "reason": "new gripper", "looked": True} | fields
        return {"recover": schema.Recover(**given)}

    async def main():
        async with (
            controller(monkeypatch) as (ports, server),
            movable(mesh, tmp_path, ports, check="require") as site,
        ):
            await until(lambda: site.controller.check == STATE.REQUIRE and not site.controller.check_text)
            before = server.controller.payload_kg
            server.controller.payload_kg = 4.0
            await until(lambda: "payload.mass" in site.controller.check_text)
            assert site.controller.check_reason.code == "check.tool_changed"
            await in_control(site)
            assert "were changed at the controller: payload.mass" in await refusal(move(site, 0.1))
            server.controller.payload_kg = before
            await until(lambda: not site.controller.check_text)
            assert "nothing to confirm" in await refusal(site.command(C.RECOVER, **confirmation()))
            await until_it_moves(site, server)
            server.controller.payload_kg = 4.0
            await until(lambda: "payload.mass" in site.controller.check_text)
            assert schema.Recover.CONFIRM_TOOL in site.controller.capabilities.recoveries
            await site.lease(A.RENEW, ttl_s=5)
            for wrong in ({"reason": ""}, {"looked": False}):
                assert "Not sent" in await refusal(site.command(C.RECOVER, **confirmation(**wrong)))
            async with asyncio.timeout(30.0):
                # The arm must be seen to rest.
                while "moves" in await answer_of(site.command(C.RECOVER, **confirmation())):
                    await site.lease(A.RENEW, ttl_s=5)
            await until(lambda: not site.controller.check_text)
            event = await site.event("recover.confirmed", -1)
            assert re.fullmatch(r"li has confirmed payload.mass .* → 4: new gripper", event.text)
            await until_it_moves(site, server)

    run(main())


async def answer_of(asked):
    try:
        return (await asked).text
    except RefusedError as error:
        return str(error)


async def until_it_moves(site, server):
    async with asyncio.timeout(30.0):
        while True:
            await site.lease(A.RENEW, ttl_s=5)
            with contextlib.suppress(Exception):
                await move(site, -0.1)
                break
            await asyncio.sleep(0.05)
    await moving(site)
    await resting(site)


@pytest.mark.parametrize("fault", ["freeze", "restart", "drop", "local", "fault"])
def test_a_fault_of_the_controller_during_a_motion_stops_it_for_good(mesh, tmp_path, monkeypatch, fault):
    async def main():
        async with controller(monkeypatch) as (ports, server), movable(mesh, tmp_path, ports) as site:
            await in_control(site)
            target = await move(site, 2.5)
            arm = server.controller
            await until(lambda: arm.programs.moving(time.monotonic()))
            server._faults.begin(fault, time.monotonic())
            await until(lambda: site.controller.HasField("stop"))
            await until(lambda: not arm.programs.moving(time.monotonic()) or server.controller is not arm)
            server._faults.end(fault)
            await until(lambda: site.controller.link == STATE.UP)
            await until(lambda: site.controller.mode == STATE.REMOTE)
            await until(lambda: not runs(server))
            assert abs(positions(server)[0] - target[0]) > 0.3
            rest = positions(server)
            await site.units(30)
            assert positions(server) == pytest.approx(rest)

    run(main())


def test_the_speed_slider_of_others_slows_the_motion_only(mesh, tmp_path, monkeypatch):
    async def main():
        async with controller(monkeypatch) as (ports, server), movable(mesh, tmp_path, ports) as site:
            await in_control(site)
            target = await move(site, 0.4)
            await until(lambda: server.controller.programs.moving(time.monotonic()))
            server.controller.write({"speed_slider_mask": 1, "speed_slider_fraction": 0.5}, time.monotonic())
            await moving(site)
            await resting(site)
            assert positions(server) == pytest.approx(target, abs=1e-6)
            assert server.controller.speed_slider == 0.5
            assert not site.controller.HasField("stop")

    run(main())


@pytest.mark.parametrize("name", ["dashboard", "rtde"])
def test_a_lost_connection_latches_a_stop_and_forbids_motion(mesh, tmp_path, monkeypatch, name):
    async def main():
        async with controller(monkeypatch) as (ports, server), wire(getattr(ports, name)) as gate:
            # The connection for reading and that for inputs have one port: both are cut.
            tapped = ports._replace(**{name: gate.port})
            async with movable(mesh, tmp_path, tapped) as site:
                await in_control(site)
                await move(site, 2.5)
                await until(lambda: server.controller.programs.moving(time.monotonic()))
                gate.cut()
                await until(lambda: site.controller.HasField("stop"))
                await until(lambda: not runs(server))
                if name == "dashboard":
                    assert site.controller.link == STATE.UP
                    assert site.controller.capabilities.stops == site.controller.capabilities.NOT_NOW
                    await site.lease(A.RENEW, ttl_s=5)
                    assert "stop" in await refusal(move(site, 0.1))
                await gate.open()
                # A latched stop is sent again as soon as its connection is back.
                await until(lambda: site.controller.stop.sent)
                await until(lambda: site.controller.mode == STATE.REMOTE)

    run(main())


def test_motion_is_refused_without_the_connection_of_the_stop(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch) as (ports, _),
            wire(ports.dashboard) as gate,
            wire(ports.scripts) as scripts,
            movable(
                mesh,
                tmp_path,
                ports,
                ports={**others(ports), "dashboard": gate.port, "scripts": scripts.port},
                accept_unknown=frozenset({"mode"}),
            ) as site,
        ):
            await in_control(site)
            gate.cut()
            await until(lambda: site.controller.capabilities.stops == site.controller.capabilities.NOT_NOW)
            assert "a stop could not be sent" in await refusal(move(site, 0.1))
            assert not scripts.data

    run(main())


def test_a_register_in_use_is_named_and_nothing_is_written(mesh, tmp_path, monkeypatch):
    async def main():
        taken = frozenset({"input_int_register_25"})
        async with (
            controller(monkeypatch, taken=taken) as (ports, server),
            movable(mesh, tmp_path, ports) as site,
        ):
            await in_control(site)
            lost = await site.event("link.channel_lost", -1)
            assert "input_int_register_25" in lost.text
            assert "another client" in lost.text
            text = await refusal(move(site, 0.1))
            assert "input_int_register_25 cannot be used" in text
            assert not runs(server)
            assert not server.controller.registers.inputs

    run(main())


@pytest.mark.parametrize("version", [(3, 15, 0, 0), (5, 5, 0, 0), (10, 7, 0, 0)])
def test_other_software_is_refused(mesh, tmp_path, monkeypatch, version):
    async def main():
        async with (
            controller(monkeypatch, version=version) as (ports, server),
            movable(mesh, tmp_path, ports, accept_unknown=frozenset({"mode"})) as site,
        ):
            await until(lambda: site.joints)
            await until(lambda: site.controller.capabilities.stops != site.controller.capabilities.NOT_NOW)
            await site.lease(A.ACQUIRE, ttl_s=5)
            assert "PolyScope 5.6" in await refusal(move(site, 0.1))
            assert not runs(server)

    run(main())


def test_without_motion_in_the_site_file_no_other_connection_is_opened(mesh, tmp_path, monkeypatch):
    async def main():
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
            assert "reads" in await refusal(site.lease(A.ACQUIRE, ttl_s=5))

    run(main())


SITE = """
site = "hall"
[[robot]]
name = "arm"
model = "puma560"
protocol = "rtde"
check = "off"
universal_robots = { motion = true }
"""


@pytest.mark.processes
def test_the_arm_stops_within_200_ms_when_the_gateway_is_killed(mesh, router, tmp_path, monkeypatch):
    monkeypatch.setattr(motion_script, "WATCHDOG_HZ", 10)

    async def main():
        async with controller(monkeypatch) as (ports, server):
            (tmp_path / "site.toml").write_text(SITE, encoding="utf-8")
            addresses = ",".join(f"{name}={port}" for name, port in others(ports).items())
            words = ("-m", "services.command_line.main", "gateway", "--site", str(tmp_path / "site.toml"))
            process = await asyncio.create_subprocess_exec(
                sys.executable,
                *words,
                *("--connect", router, "--controller", f"arm=tcp://127.0.0.1:{ports.rtde},{addresses}"),
                cwd=tmp_path,
            )
            try:
                return await killed(process, server)
            finally:
                if process.returncode is None:
                    process.kill()

    async def killed(process, server):
        async with watching(mesh) as site:
            await in_control(site)
            await site.command(C.SPEED, speed_percent=100)
            programs = server.controller.programs
            async with asyncio.timeout(60.0):
                while True:
                    # A gateway that a busy machine holds up for 0.1 s has its arm stopped, too.
                    with contextlib.suppress(Exception):
                        await move(site, 2.0)
                    await asyncio.sleep(0.8)
                    if abs(programs.arm(time.monotonic()).velocities).max() > 1.0:
                        break
                    await site.lease(A.RENEW, ttl_s=5)
            process.send_signal(signal.SIGKILL)
            killed_s = before_s = time.monotonic()
            longest_s = 0.0
            while programs.moving(before_s):
                await asyncio.sleep(0.001)
                longest_s, before_s = max(longest_s, time.monotonic() - before_s), time.monotonic()
            assert not runs(server) or programs.state is RuntimeState.STOPPING
            print(f"at rest {before_s - killed_s:.3f} s after the kill")
            # What this event loop, which is also the controller's, was late itself does not count.
            assert before_s - killed_s < 0.2 + 2 * longest_s

    run(main(), timeout_s=120.0)


@contextlib.asynccontextmanager
async def watching(mesh):
    """Watch and command a robot whose gateway runs elsewhere."""
    from robomesh.session import open_session
    from tests.protocol_gateway.gateway_site import GatewaySite, watch

    async with open_session(mesh) as session:
        site = GatewaySite(session, None)
        topics = ("joints", "controller", "events")
        tasks = [asyncio.create_task(watch(session, site, topic)) for topic in topics]
        try:
            yield site
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
