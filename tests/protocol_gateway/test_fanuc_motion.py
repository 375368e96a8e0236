"""Motion of a robot of FANUC: gateway and simulated controller over real sockets."""

import asyncio
import contextlib
import math
import signal
import sys
import time
from dataclasses import replace

import pytest

from robomesh.schemas import robomesh_pb2 as schema
from tests.conftest import run
from tests.protocol_gateway.fanuc_site import (
    FANUC,
    MOVES,
    arm_moves,
    controller,
    in_control,
    movable,
    move,
    moving,
    packets,
    positions,
    resting,
    runs,
    tour,
)
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, kept_control, refusal, until
from tests.protocol_gateway.test_program_runs import ended, start
from tests.protocol_gateway.test_ur_motion import watching
from tests.protocol_gateway.wire import wire

pytestmark = pytest.mark.slow
READS = replace(MOVES, motion=False)
FAST = replace(MOVES, rate_hz=100.0)


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
    await resting(site)
    await site.lease(A.RENEW, ttl_s=5)
    await site.command(C.RESET, stop_id=site.controller.stop.id)


def test_targets_are_absolute_and_nothing_stays_in_the_controller(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch) as (ports, server),
            wire(ports.rmi) as first,
            wire(ports.session) as session,
            movable(mesh, tmp_path, ports._replace(rmi=first.port), session=session.port) as site,
        ):
            await until(lambda: site.joints)
            assert not server.received
            await in_control(site)
            assert server.received == ["FRC_Connect"]
            before = positions(server)
            async with kept_control(site):
                await site.command(C.SPEED, speed_percent=50)
                target = await move(site, 0.2)
                await moving(site)
                await resting(site)
                assert positions(server) == pytest.approx(target, abs=1e-6)
                assert not runs(server)
                await site.command(C.MOVE_RELATIVE, joint_positions=[-0.2, 0.1, 0, 0, 0, 0])
                await moving(site)
                await resting(site)
                assert positions(server)[0] == pytest.approx(before[0], abs=1e-5)
                assert positions(server)[1] == pytest.approx(before[1] + 0.1, abs=1e-5)
                assert "homed" in await refusal(site.command(C.HOME))
                assert "no HOLD" in await refusal(site.command(C.HOLD))
                # The core knows that the motion has ended with the next statuses.
                await site.units(30)
                assert not site.controller.HasField("stop")
                await site.lease(A.RELEASE)
            await until(lambda: server.session is None)
            assert packets(first.sent) == [{"Communication": "FRC_Connect"}]
            sent = packets(session.sent)
            motion = ["FRC_Initialize", "FRC_JointMotionJRep", "FRC_Abort"]
            assert [next(iter(each.values())) for each in sent] == [*motion, *motion, "FRC_Disconnect"]
            for each in (sent[1], sent[4]):
                assert (each["SequenceID"], each["TermType"], each["SpeedType"]) == (1, "FINE", "Percent")
                assert each["Speed"] == 50

    run(main())


def test_a_program_makes_one_motion_after_the_other(mesh, tmp_path, monkeypatch):
    text = "speed 100\nrepeat 2\n  move_joints 10 -90 180 0 45 0\n  move_joints 0 -90 180 0 55 0\nend\n"

    async def main():
        async with controller(monkeypatch) as (ports, server), movable(mesh, tmp_path, ports) as site:
            await in_control(site)
            async with kept_control(site):
                await start(site, text)
                await ended(site, schema.ProgramState.DONE)
            assert server.received.count("FRC_JointMotionJRep") == 4
            assert not site.controller.HasField("stop")

    run(main(), timeout_s=120.0)


def test_a_stop_ends_the_motion_and_a_reset_sends_nothing(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch) as (ports, server),
            movable(mesh, tmp_path, ports, motion=FAST) as site,
        ):
            await in_control(site)
            async with kept_control(site):
                target = await move(site, 2.0)
                await until(lambda: arm_moves(server))
                answer = await site.stop(by="wang")
                assert answer.sent
                await until(lambda: not runs(server) and not arm_moves(server))
                assert abs(positions(server)[0] - target[0]) > 0.5
                assert "stop 1 is latched" in await refusal(move(site, 0.1))
                await reset(site)
                assert "FRC_Reset" not in server.received
                rest = positions(server)
                await site.units(20)
                assert positions(server) == pytest.approx(rest)
                await move(site, -0.2)
                await moving(site)
                await resting(site)
                assert positions(server)[0] == pytest.approx(rest[0] - 0.2, abs=1e-5)

    run(main())


def test_a_stop_during_the_initialization_prevents_the_motion(mesh, tmp_path, monkeypatch):
    monkeypatch.setattr("services.simulator.fanuc.rmi_server.INITIALIZE_S", 0.5)

    async def main():
        async with controller(monkeypatch) as (ports, server), movable(mesh, tmp_path, ports) as site:
            await in_control(site)
            rest = positions(server)
            await move(site, 2.0)
            await until(lambda: "FRC_Initialize" in server.received)
            assert (await site.stop(by="wang")).sent
            # The controller refuses a command while it is busy with another one: the abort is repeated.
            await until(lambda: server.controller.rmi is not None and not runs(server))
            assert server.received.count("FRC_Abort") > 1
            assert "FRC_JointMotionJRep" not in server.received
            assert positions(server) == pytest.approx(rest)
            await resting(site)

    run(main())


async def went_local(server):
    server.controller.pendant_enabled = True
    server.controller.pause_rmi(time.monotonic(), fault=True)


async def failed(server):
    server.controller.raise_alarm(11, 1, "SRVO-001 Operator panel E-stop", time.monotonic())


async def paused(server):
    server.controller.pause_rmi(time.monotonic(), fault=False)


async def ended_by_others(server):
    server.controller.rmi.abort(time.monotonic())


async def other_tool(server):
    server.controller.tool_number = 2


async def told_of_a_fault(server):
    server.session.send("Communication", "FRC_SystemFault", SequenceID=1)


async def refused(server):
    server.session.send("Instruction", "FRC_JointMotionJRep", ErrorID=2556964, SequenceID=1)


@pytest.mark.parametrize(
    ("happens", "codes"),
    [
        (went_local, {"fanuc.went_local", "fanuc.system_fault", "fanuc.arm_stopped"}),
        (failed, {"fanuc.system_fault", "fanuc.arm_stopped"}),
        (paused, {"fanuc.arm_stopped"}),
        (ended_by_others, {"fanuc.lost_program"}),
        (other_tool, {"fanuc.tool_changed"}),
        (told_of_a_fault, {"fanuc.system_fault"}),
        (refused, {"fanuc.refused"}),
    ],
)
def test_what_others_do_during_a_motion_latches_a_stop(mesh, tmp_path, monkeypatch, happens, codes):
    async def main():
        async with controller(monkeypatch) as (ports, server), movable(mesh, tmp_path, ports) as site:
            await in_control(site)
            await site.command(C.SPEED, speed_percent=20)
            target = await move(site, 2.5)
            await until(lambda: arm_moves(server))
            await happens(server)
            await until(lambda: site.controller.HasField("stop"))
            why = site.controller.stop.why
            assert why.code == "stop.fate_unknown"
            assert codes & {each.code for each in _causes(why)}, why
            await until(lambda: not arm_moves(server) and not runs(server))
            assert abs(positions(server)[0] - target[0]) > 0.3
            assert server.received.count("FRC_JointMotionJRep") == 1
            assert not {"FRC_Reset", "FRC_Continue"} & {*server.received}

    run(main())


def test_nothing_is_sent_while_another_program_runs(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch, demo=True) as (ports, server),
            movable(mesh, tmp_path, ports) as site,
        ):
            await in_control(site)
            await moving(site)
            assert "another program" in await refusal(move(site, 0.1))
            server.controller.end_program(time.monotonic())
            async with kept_control(site):
                await resting(site)
                await move(site, 0.05)
                await moving(site)
                await resting(site)
                await site.units(30)
            # Between motions, a program that begins under the lease is another one.
            server.controller.start_program(tour(server), time.monotonic())
            await until(lambda: site.events("motion.foreign"))
            await until(lambda: site.seen["lease"][-1].holder == "")
            assert server.received.count("FRC_Initialize") == 1

    run(main())


def test_a_taken_seat_forbids_motion(mesh, tmp_path, monkeypatch):
    async def main():
        async with controller(monkeypatch) as (ports, server):
            server._granted_s = math.inf  # another client has it
            async with movable(mesh, tmp_path, ports) as site:
                await until(lambda: site.joints)
                await until(lambda: site.controller.mode == STATE.REMOTE)
                await site.lease(A.ACQUIRE, ttl_s=5)
                lost = await site.event("link.channel_lost", -1)
                assert "already connected" in lost.text
                assert "a stop could not be sent" in await refusal(move(site, 0.1))
                server._granted_s = -math.inf
                await until(lambda: site.controller.capabilities.stops == site.controller.capabilities.OURS)
            assert {*server.received} <= {"FRC_Connect", "FRC_Disconnect"}

    run(main())


@pytest.mark.parametrize("way", ["cut", "swallowed"])
def test_a_lost_session_latches_a_stop_that_is_delivered(mesh, tmp_path, monkeypatch, way):
    monkeypatch.setattr("protocol_gateway.drivers.fanuc.motion_driver.ANSWER_S", 1.0)

    async def main():
        async with (
            controller(monkeypatch) as (ports, server),
            wire(ports.session) as session,
            movable(mesh, tmp_path, ports, session=session.port) as site,
        ):
            await in_control(site)
            await site.command(C.SPEED, speed_percent=20)
            target = await move(site, 2.5)
            await until(lambda: arm_moves(server))
            if way == "cut":
                session.cut()
                await stopped_for(site, "fanuc.connection_lost")
                await session.open()
            else:
                session.swallows = True
                assert (await site.stop(by="wang")).sent
                await asyncio.sleep(0)
                session.swallows = False
            # The abort is sent in a new session, and a motion never again.
            await until(lambda: not runs(server))
            assert server.received.count("FRC_JointMotionJRep") == 1
            assert abs(positions(server)[0] - target[0]) > 0.3
            await until(lambda: site.controller.stop.sent)

    run(main())


def test_a_lost_answer_latches_a_stop(mesh, tmp_path, monkeypatch):
    monkeypatch.setattr("protocol_gateway.drivers.fanuc.motion_driver.SILENT_S", 1.0)

    async def main():
        async with controller(monkeypatch) as (ports, server), movable(mesh, tmp_path, ports) as site:
            await in_control(site)
            send = server.session.send
            lost = {"FRC_JointMotionJRep"}
            server.session.send = lambda kind, name, **values: name in lost or send(kind, name, **values)
            await move(site, 0.2)
            await stopped_for(site, "fanuc.no_answer")
            await until(lambda: not runs(server))
            assert server.received.count("FRC_JointMotionJRep") == 1

    run(main())


def test_a_restart_of_the_controller_latches_a_stop_and_begins_the_numbers_again(mesh, tmp_path, monkeypatch):
    async def main():
        async with controller(monkeypatch) as (ports, server), movable(mesh, tmp_path, ports) as site:
            await in_control(site)
            await site.command(C.SPEED, speed_percent=20)
            await move(site, 2.5)
            await until(lambda: arm_moves(server))
            server.snpx.controller = server.snpx._boot(False)
            server.close()
            server.snpx.close()
            await until(lambda: site.controller.HasField("stop"))
            await until(lambda: server.session is not None)
            await until(lambda: site.controller.stop.sent)
            await reset(site)
            async with kept_control(site):
                await until(lambda: site.controller.capabilities.stops == site.controller.capabilities.OURS)
                target = await move(site, 0.1)
                await moving(site)
                await resting(site)
            assert positions(server) == pytest.approx(target, abs=1e-6)

    run(main())


def test_without_motion_in_the_site_file_rmi_is_never_connected(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch, demo=True) as (ports, server),
            gateway(mesh, tmp_path, ports.snpx, **FANUC, options=READS) as site,
        ):
            await until(lambda: site.joints)
            assert not (await site.stop(by="wang")).sent
            assert "reads" in await refusal(site.lease(A.ACQUIRE, ttl_s=5))
            await site.units(20)
            assert not server.received
            assert server.session is None

    run(main())


SITE = """
site = "hall"
[[robot]]
name = "arm"
model = "puma560"
protocol = "snpx"
check = "off"
fanuc = { assignments = "own", j23 = 1, motion = true, speed = 100 }
"""


@contextlib.asynccontextmanager
async def gateway_process(router, folder, ports):
    """Run a gateway as a subprocess; yield the process."""
    (folder / "site.toml").write_text(SITE, encoding="utf-8")
    words = ("-m", "services.command_line.main", "gateway", "--site", str(folder / "site.toml"))
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        *words,
        *("--connect", router, "--controller", f"arm=tcp://127.0.0.1:{ports.snpx},rmi={ports.rmi}"),
        cwd=folder,
    )
    try:
        yield process
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()


@pytest.mark.processes
def test_the_motion_of_a_killed_gateway_is_ended_by_the_next_one(mesh, router, tmp_path, monkeypatch):
    async def main():
        async with controller(monkeypatch) as (ports, server), watching(mesh) as site:
            async with gateway_process(router, tmp_path, ports) as process:
                await in_control(site)
                await site.command(C.SPEED, speed_percent=3)
                target = await move(site, 2.5)
                await until(lambda: arm_moves(server))
                process.send_signal(signal.SIGKILL)
                await process.wait()
            await until(lambda: server.session is None)
            # RMI has no dead man: the arm goes on.
            assert arm_moves(server)
            async with gateway_process(router, tmp_path, ports):
                # A process takes some seconds to start.
                await until(lambda: server.received.count("FRC_Abort"), 60.0)
                await until(lambda: not runs(server))
                await until(lambda: not arm_moves(server))
                await until(lambda: site.controller.HasField("stop") and site.controller.stop.sent)
            assert abs(positions(server)[0] - target[0]) > 0.3
            assert server.received.count("FRC_JointMotionJRep") == 1

    run(main(), timeout_s=120.0)
