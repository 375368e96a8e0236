"""Motion of a robot of Yaskawa by HSES: gateway and simulated controller over real sockets."""

import asyncio
import contextlib
import math
import signal
import struct
import sys
import time
from dataclasses import replace

import pytest

from protocol_gateway.drivers.yaskawa.data import Status1
from protocol_gateway.drivers.yaskawa.motion_driver import HsesMotionDriver, hses_driver
from protocol_gateway.errors import GatewaySettingsError
from robomesh.errors import RefusedError
from robots.joints import JointType
from services.simulator.yaskawa.controller import Refusal
from tests.conftest import run
from tests.protocol_gateway.gateway_site import STATE, A, C, refusal, until
from tests.protocol_gateway.hses_site import (
    HOLD,
    HSES,
    MOVE,
    command,
    controller,
    in_control,
    motions,
    movable,
    move,
    written,
)
from tests.protocol_gateway.test_ur_motion import watching
from tests.protocol_gateway.wire import wire

pytestmark = pytest.mark.slow

HOLD_ON, HOLD_OFF = (HOLD, 1, 1), (HOLD, 1, 2)


def moving(site):
    return until(lambda: site.controller.activity == STATE.MOVING)


def resting(site):
    return until(lambda: site.controller.activity == STATE.IDLE)


def positions(server):
    return server.controller.positions(time.monotonic())


def moves(server):
    return server.controller.moves(time.monotonic())


def codes(reason):
    return [reason.code, *(code for each in reason.causes for code in codes(each))]


async def stopped_for(site, code):
    """Wait until the gateway has latched a stop because a fate is unknown, for a reason."""
    await until(lambda: site.controller.HasField("stop"))
    found = codes(site.controller.stop.why)
    assert found[0] == "stop.fate_unknown"
    assert code in found, site.controller.stop


async def until_reset(site, server):
    """Reset the stop over a held motion, as the manual says: without servos."""
    await until(lambda: site.controller.activity == STATE.HOLDING)
    await site.lease(A.RENEW, ttl_s=5)
    reset = {"stop_id": site.controller.stop.id}
    async with asyncio.timeout(30.0):
        # Until the status is newer than HOLD.
        while "may go on when HOLD ends" not in (text := await refusal(site.command(C.RESET, **reset))):
            assert "too old" in text
    server.controller.switch_servos(False, time.monotonic())
    async with asyncio.timeout(30.0):
        while site.controller.HasField("stop"):
            await site.lease(A.RENEW, ttl_s=5)
            with contextlib.suppress(RefusedError):
                await site.command(C.RESET, **reset)
            await asyncio.sleep(0.05)
    await until(lambda: site.controller.activity == STATE.STOPPED)
    server.controller.switch_servos(True, time.monotonic())
    await resting(site)


def test_targets_are_absolute_pulses_and_nothing_else_is_written(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch) as (port, server),
            movable(mesh, tmp_path, port) as (site, relay),
        ):
            server.controller.tool = 3
            await in_control(site)
            before = positions(server)
            await site.command(C.SPEED, speed_percent=50)
            target = await move(site, 0.2)
            await moving(site)
            await resting(site)
            assert positions(server) == pytest.approx(target, abs=2e-5)
            await site.command(C.MOVE_RELATIVE, joint_positions=[-0.2, 0.1, 0, 0, 0, 0])
            await moving(site)
            await resting(site)
            assert positions(server)[:2] == pytest.approx([before[0], before[1] + 0.1], abs=1e-4)
            assert not site.controller.HasField("stop")
            assert written(relay) == [(MOVE, 1, None)] * 2
            first = motions(relay)[0]
            assert (first[28], first[29], len(first)) == (1, 0x02, 32 + 88)
            numbers = struct.unpack("<22i", first[32:])
            pulses = [round(math.degrees(each) * 1000) for each in target]
            assert numbers == (1, 0, 0, 5000, *pulses, 0, 0, 3, *[0] * 9)
            for each in (C.HOME, C.HOLD, C.RESUME):
                await refusal(site.command(each))
            assert len(written(relay)) == 2

    run(main())


def test_a_stop_holds_and_nothing_goes_on_after_its_reset(mesh, tmp_path, monkeypatch):
    async def main():
        # This controller is the worse of both kinds: it continues a held motion when HOLD ends.
        async with (
            controller(monkeypatch, held_motions_go_on=True) as (port, server),
            movable(mesh, tmp_path, port) as (site, relay),
        ):
            await in_control(site)
            target = await move(site, 2.0)
            await until(lambda: moves(server))
            assert (await site.stop(by="wang")).sent
            await until(lambda: not moves(server))
            assert abs(positions(server)[0] - target[0]) > 0.5
            assert HOLD_ON in written(relay)
            assert "stop 1 is latched" in await refusal(move(site, 0.1))
            rest = positions(server)
            await until_reset(site, server)
            await site.units(20)
            assert positions(server) == pytest.approx(rest)
            assert written(relay).count(HOLD_OFF) == 1
            await site.lease(A.RENEW, ttl_s=5)
            await move(site, -0.2)
            await moving(site)
            await resting(site)
            assert positions(server)[0] == pytest.approx(rest[0] - 0.2, abs=1e-4)
            # At rest nothing is held back, so the servos stay on.
            await site.stop(by="wang")
            await until(lambda: site.controller.activity == STATE.HOLDING)
            await site.lease(A.RENEW, ttl_s=5)
            await site.command(C.RESET, stop_id=site.controller.stop.id)
            await resting(site)
            assert len(motions(relay)) == server.controller.commands == 2

    run(main(), timeout_s=90.0)


def test_hold_is_set_again_while_the_stop_is_latched(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch) as (port, server),
            movable(mesh, tmp_path, port) as (site, relay),
        ):
            await in_control(site)
            lost = []

            def loses_the_first(data):
                if command(data) == HOLD and len(lost) < 4:
                    lost.append(data)
                    return []
                return [data]

            relay.commands = loses_the_first
            await move(site, 2.0)
            await until(lambda: moves(server))
            await site.stop(by="wang")
            await until(lambda: not moves(server))
            await until(lambda: site.controller.activity == STATE.HOLDING)
            assert len(lost) == 4
            # Another client ends HOLD; each repetition has another number.
            server.controller.hold(False, time.monotonic())
            await until(lambda: server.controller._held)
            numbers = [each[11] for each in relay.sent if command(each) == HOLD]
            assert len({*numbers}) >= 4

    run(main())


def test_a_lost_answer_of_a_motion_does_not_send_it_again(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch) as (port, server),
            movable(mesh, tmp_path, port) as (site, relay),
        ):
            await in_control(site)
            relay.answers = lambda data: [] if data[24] == 0x82 else [data]
            target = await move(site, 0.3)
            await moving(site)
            await resting(site)
            assert positions(server) == pytest.approx(target, abs=2e-5)
            # Doubled datagrams, as UDP may: the controller refuses the second, whose answer is not used.
            relay.answers = lambda data: [data, data]
            relay.commands = lambda data: [data, data]
            target = await move(site, -0.3)
            await moving(site)
            await resting(site)
            assert positions(server) == pytest.approx(target, abs=2e-5)
            assert not site.controller.HasField("stop")
            # The refusal of the copy overtakes the answer of the motion.
            kept = []

            def overtaken(data):
                if data[24] != 0x82:
                    return [data]
                kept.append(data)
                return kept[::-1] if len(kept) == 2 else []

            relay.answers = overtaken
            target = await move(site, 0.3)
            await moving(site)
            await resting(site)
            assert [each[25] for each in kept] == [0, 0x1F]
            assert positions(server) == pytest.approx(target, abs=2e-5)
            assert not site.controller.HasField("stop")
            assert len(motions(relay)) == 3

    run(main())


def test_a_refused_motion_is_over_and_its_refusal_is_shown(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch) as (port, server),
            movable(mesh, tmp_path, port) as (site, relay),
        ):
            await in_control(site)
            monkeypatch.setattr(server.controller, "move", lambda *given: Refusal.NOT_REMOTE)
            await move(site, 0.3)
            event = await site.event("controller.refused", -1)
            assert "remote control by commands is off (status 0x1F, 0x2100)" in event.text
            await resting(site)
            assert not site.controller.HasField("stop")
            monkeypatch.undo()
            await site.lease(A.RENEW, ttl_s=5)
            await move(site, 0.1)
            await moving(site)
            await resting(site)
            assert len(motions(relay)) == 2

    run(main())


def test_a_lost_motion_latches_a_stop_and_cannot_begin_later(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch) as (port, server),
            movable(mesh, tmp_path, port) as (site, relay),
        ):
            await in_control(site)
            late = []
            relay.commands = lambda data: late.append(data) or [] if command(data) == MOVE else [data]
            await move(site, 0.5)
            await stopped_for(site, "hses.not_started")
            await until(lambda: server.controller._held)
            rest = positions(server)
            server.datagram_received(late[0], ("127.0.0.1", 9))
            assert server.controller.commands == 0
            assert len(late) == 1
            await until_reset(site, server)
            assert positions(server) == pytest.approx(rest)

    run(main())


def test_a_late_answer_of_an_earlier_motion_says_nothing_about_a_later_one(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch) as (port, _),
            movable(mesh, tmp_path, port) as (site, relay),
        ):
            await in_control(site)
            kept = []
            relay.answers = lambda data: kept.append(data) or [] if data[24] == 0x82 else [data]
            await move(site, 0.1)
            await moving(site)
            await resting(site)
            # The second motion is lost, and answers of the first arrive in its place.
            relay.commands = lambda data: [] if command(data) == MOVE else [data]
            relay.answers = lambda data: [data, kept[0]] if data[24] == 0x81 else [data]
            await move(site, 0.1)
            await stopped_for(site, "hses.not_started")

    run(main())


def went_local(server):
    server.controller.mode = Status1.PLAY


def taught(server):
    server.controller.mode = Status1.TEACH


def held(server):
    server.controller.press_hold(time.monotonic())


def alarmed(server):
    server.controller.raise_alarm(4315, 1, "COLLISION DETECT", time.monotonic())


def without_servos(server):
    server.controller.switch_servos(False, time.monotonic())


def other_tool(server):
    server.controller.tool = 5


@pytest.mark.parametrize(
    ("happens", "code"),
    [
        (went_local, "hses.went_local"),
        (held, "hses.held"),
        (alarmed, "hses.arm_stopped"),
        (without_servos, "hses.arm_stopped"),
        (other_tool, "hses.tool_changed"),
    ],
)
def test_what_others_do_during_a_motion_latches_a_stop(mesh, tmp_path, monkeypatch, happens, code):
    async def main():
        async with (
            controller(monkeypatch) as (port, server),
            movable(mesh, tmp_path, port) as (site, relay),
        ):
            await in_control(site)
            await move(site, 2.5)
            await until(lambda: moves(server))
            happens(server)
            await stopped_for(site, code)
            await until(lambda: HOLD_ON in written(relay))
            assert len(motions(relay)) == 1

    run(main())


def test_a_stop_that_the_mode_forbids_is_shown_and_sent_again_in_remote(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch) as (port, server),
            movable(mesh, tmp_path, port) as (site, relay),
        ):
            await in_control(site)
            await move(site, 2.5)
            await until(lambda: moves(server))
            taught(server)
            await stopped_for(site, "hses.went_local")
            alarm = await site.event("controller.alarm", -1)
            assert "refuses HOLD: the mode is wrong (status 0x1F, 0x2080)" in alarm.text
            # HOLD is what it says it is: here the motion runs on.
            assert moves(server)
            server.controller.mode = Status1.PLAY | Status1.REMOTE
            await until(lambda: server.controller._held)
            await until(lambda: not moves(server))
            assert (HOLD, 2, 2) not in written(relay)

    run(main())


@pytest.mark.parametrize(
    ("prepare", "text"),
    [
        (went_local, "local"),
        (without_servos, "stopped"),
        (alarmed, "fault"),
        (held, "hold"),
    ],
)
def test_a_motion_is_refused_in_words(mesh, tmp_path, monkeypatch, prepare, text):
    async def main():
        async with (
            controller(monkeypatch) as (port, server),
            movable(mesh, tmp_path, port) as (site, relay),
        ):
            await in_control(site)
            prepare(server)
            await site.units(20)
            assert text in (await refusal(move(site, 0.1))).lower()
            assert not written(relay)

    run(main())


def test_nothing_is_sent_while_another_job_runs(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch, demo=True) as (port, server),
            movable(mesh, tmp_path, port) as (site, relay),
        ):
            await in_control(site)
            await moving(site)
            assert "a job runs" in await refusal(move(site, 0.1))
            server.controller.press_hold(time.monotonic())
            await until(lambda: site.controller.activity == STATE.HOLDING)
            server.controller.held_at_pendant = False
            await resting(site)
            await site.lease(A.RENEW, ttl_s=5)
            await move(site, 0.05)
            await moving(site)
            await resting(site)
            server.controller.start(time.monotonic())
            await until(lambda: site.events("motion.foreign"))
            await until(lambda: site.seen["lease"][-1].holder == "")
            assert len(motions(relay)) == 1

    run(main())


def test_a_dead_socket_of_the_stop_forbids_motion_and_ends_one(mesh, tmp_path, monkeypatch):
    # On a controller all sockets are one port.
    monkeypatch.setattr(HsesMotionDriver, "ports", frozenset({"stop"}))

    async def main():
        async with (
            controller(monkeypatch) as (port, server),
            wire(port, datagrams=True) as second,
            movable(mesh, tmp_path, port, ports={"stop": second.port}) as (site, relay),
        ):
            await in_control(site)
            await move(site, 2.5)
            await until(lambda: moves(server))
            second.swallows = True
            await stopped_for(site, "hses.channel_lost")
            # HOLD went by the other socket.
            await until(lambda: not moves(server))
            assert HOLD_ON in written(relay)
            await until(lambda: site.controller.capabilities.stops == site.controller.capabilities.NOT_NOW)
            assert site.controller.link == STATE.UP
            await site.lease(A.RENEW, ttl_s=5)
            sent = len(motions(relay))
            await refusal(move(site, 0.1))
            second.swallows = False
            await until(lambda: site.controller.capabilities.stops != site.controller.capabilities.NOT_NOW)
            assert len(motions(relay)) == sent == 1

    run(main())


def test_axes_of_others_forbid_motion_also_after_a_restart(mesh, tmp_path, monkeypatch):
    async def main():
        async with (
            controller(monkeypatch) as (port, _),
            controller(monkeypatch, faults=("joints",)) as (other, _),
            movable(mesh, tmp_path, port, reconnect_after_s=1.5, stale_after_s=0.5) as (site, relay),
        ):
            await until(lambda: site.joints)
            relay.swallows = True
            await until(lambda: site.controller.link == STATE.DOWN)
            await relay.lead_to(other)
            await until(lambda: site.controller.link == STATE.UP)
            await until(lambda: site.controller.joints_unproven)
            assert "axis E of its controller" in await refusal(site.lease(A.ACQUIRE, ttl_s=5))
            assert not site.controller.capabilities.commands
            assert not motions(relay)

    run(main())


SITE = """
site = "hall"
[[robot]]
name = "arm"
model = "puma560"
protocol = "hses"
check = "off"
yaskawa = { motion = true }
"""


@pytest.mark.processes
def test_a_motion_runs_on_when_the_gateway_is_killed_and_the_next_one_holds_it(
    mesh, router, tmp_path, monkeypatch
):
    """HSES has no dead man. What docs/controllers/yaskawa.md says of it is tried here."""
    (tmp_path / "site.toml").write_text(SITE, encoding="utf-8")

    async def started(port):
        words = ("-m", "services.command_line.main", "gateway", "--site", str(tmp_path / "site.toml"))
        address = ("--connect", router, "--controller", f"arm=udp://127.0.0.1:{port}")
        return await asyncio.create_subprocess_exec(sys.executable, *words, *address, cwd=tmp_path)

    async def main():
        async with controller(monkeypatch) as (port, server):
            process = await started(port)
            try:
                async with watching(mesh) as site:
                    await until(lambda: site.seen.get("joints"), timeout_s=90.0)
                    await in_control(site)
                    await site.command(C.SPEED, speed_percent=2)
                    await move(site, 2.0)
                    await until(lambda: moves(server))
                    process.send_signal(signal.SIGKILL)
                    await process.wait()
                    before = positions(server)[0]
                    await until(lambda: positions(server)[0] > before + 0.05)
                    process = await started(port)
                    # Its audit log says that an operator had control.
                    await until(lambda: server.controller._held, timeout_s=90.0)
                    await until(lambda: not moves(server))
            finally:
                process.kill()
                await process.wait()

    run(main(), timeout_s=240.0)


def test_the_site_file_must_say_how_many_pulses_and_which_robot():
    six, options = (JointType.ROTARY,) * 6, HSES["options"]
    for wrong in (replace(options, pulses_per_degree=()), replace(options, group="S1")):
        with pytest.raises(GatewaySettingsError, match="yaskawa motion"):
            hses_driver(six, {}, relay=None, options=wrong)
    reads = hses_driver(six, {}, relay=None, options=replace(options, motion=False))
    assert not isinstance(reads, HsesMotionDriver)
    assert not reads.capabilities.commands
