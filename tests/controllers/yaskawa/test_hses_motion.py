"""Motion of a robot of Yaskawa by HSES: gateway and simulated controller over real sockets."""

import asyncio
import contextlib
import math
import struct
import time
from dataclasses import replace

import pytest

from controllers.yaskawa.data import Status1
from controllers.yaskawa.motion_driver import HsesMotionDriver, hses_driver
from controllers.yaskawa.simulated.controller import Refusal
from protocol_gateway.seam.errors import GatewaySettingsError
from robomesh.errors import RefusedError
from robots.kinematics.joints import JointType
from tests.controllers.simulated_site import move
from tests.controllers.yaskawa.hses_site import (
    HOLD,
    HSES,
    MOVE,
    command,
    controller,
    in_control,
    motions,
    movable,
    written,
)
from tests.protocol_gateway.gateway_site import STATE, A, C, moving, refusal, resting, stopped_for, until

pytestmark = pytest.mark.slow

HOLD_ON, HOLD_OFF = (HOLD, 1, 1), (HOLD, 1, 2)


@contextlib.asynccontextmanager
async def commanded(mesh, folder, monkeypatch, **settings):
    """Control a movable robot; yield its simulated controller, site and wire."""
    async with (
        controller(monkeypatch, **settings) as (port, server),
        movable(mesh, folder, port) as (site, relay),
    ):
        await in_control(site)
        yield server, site, relay


def positions(server):
    return server.controller.positions(time.monotonic())


def moves(server):
    return server.controller.moves(time.monotonic())


async def until_reset(site, server):
    """Reset the stop over a held motion, as the manual says: without servos."""
    await until(lambda: site.controller.activity == STATE.HOLDING)
    await site.lease(A.RENEW)
    reset = {"stop_id": site.controller.stop.id}
    async with asyncio.timeout(30.0):
        # Until the status is newer than HOLD.
        while "may go on when HOLD ends" not in (text := await refusal(site.command(C.RESET, **reset))):
            assert "too old" in text
    server.controller.switch_servos(False, time.monotonic())
    async with asyncio.timeout(30.0):
        while site.controller.HasField("stop"):
            await site.lease(A.RENEW)
            with contextlib.suppress(RefusedError):
                await site.command(C.RESET, **reset)
            await asyncio.sleep(0.05)
    await until(lambda: site.controller.activity == STATE.STOPPED)
    server.controller.switch_servos(True, time.monotonic())
    await resting(site)


async def test_targets_are_absolute_pulses_and_nothing_else_is_written(mesh, tmp_path, monkeypatch):
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


async def test_a_stop_holds_and_nothing_goes_on_after_its_reset(mesh, tmp_path, monkeypatch):
    # This controller is the worse of both kinds: it continues a held motion when HOLD ends.
    async with commanded(mesh, tmp_path, monkeypatch, held_motions_go_on=True) as (server, site, relay):
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
        await site.lease(A.RENEW)
        await move(site, -0.2)
        await moving(site)
        await resting(site)
        assert positions(server)[0] == pytest.approx(rest[0] - 0.2, abs=1e-4)
        # At rest nothing is held back, so the servos stay on.
        await site.stop(by="wang")
        await until(lambda: site.controller.activity == STATE.HOLDING)
        await site.lease(A.RENEW)
        await site.command(C.RESET, stop_id=site.controller.stop.id)
        await resting(site)
        assert len(motions(relay)) == server.controller.commands == 2


async def test_hold_is_set_again_while_the_stop_is_latched(mesh, tmp_path, monkeypatch):
    async with commanded(mesh, tmp_path, monkeypatch) as (server, site, relay):
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


async def test_a_refused_copy_of_a_motion_says_nothing_about_it(mesh, tmp_path, monkeypatch):
    """UDP may double the motion, and the refusal of the copy may overtake the answer of the motion."""
    async with commanded(mesh, tmp_path, monkeypatch) as (server, site, relay):
        kept = []

        def overtaken(data):
            if data[24] != 0x82:
                return [data]
            kept.append(data)
            return kept[::-1] if len(kept) == 2 else []

        relay.answers = overtaken
        relay.commands = lambda data: [data, data]
        target = await move(site, 0.3)
        await moving(site)
        await resting(site)
        assert [each[25] for each in kept] == [0, 0x1F]
        assert positions(server) == pytest.approx(target, abs=2e-5)
        assert not site.controller.HasField("stop")
        assert len(motions(relay)) == 1


async def test_a_refused_motion_is_over_and_its_refusal_is_shown(mesh, tmp_path, monkeypatch):
    async with commanded(mesh, tmp_path, monkeypatch) as (server, site, relay):
        monkeypatch.setattr(server.controller, "move", lambda *given: Refusal.NOT_REMOTE)
        await move(site, 0.3)
        event = await site.event("controller.refused", -1)
        assert "remote control by commands is off (status 0x1F, 0x2100)" in event.text
        await resting(site)
        assert not site.controller.HasField("stop")
        monkeypatch.undo()
        await site.lease(A.RENEW)
        await move(site, 0.1)
        await moving(site)
        await resting(site)
        assert len(motions(relay)) == 2


async def test_a_late_answer_of_an_earlier_motion_says_nothing_about_a_later_one(mesh, tmp_path, monkeypatch):
    async with commanded(mesh, tmp_path, monkeypatch) as (_, site, relay):
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


async def test_a_motion_is_refused_in_words(mesh, tmp_path, monkeypatch):
    async with commanded(mesh, tmp_path, monkeypatch) as (server, site, relay):
        arm, now = server.controller, time.monotonic
        for text, begin, end in (
            ("stopped", lambda: arm.switch_servos(False, now()), lambda: arm.switch_servos(True, now())),
            ("hold", lambda: arm.press_hold(now()), lambda: setattr(arm, "held_at_pendant", False)),
            ("fault", lambda: arm.raise_alarm(4315, 1, "COLLISION", now()), lambda: arm.reset(now())),
            ("local", lambda: setattr(arm, "mode", Status1.PLAY), lambda: None),
        ):
            begin()
            await site.units(20)
            await site.lease(A.RENEW)
            assert text in (await refusal(move(site, 0.1))).lower()
            end()
            await resting(site)
        assert not written(relay)


def test_the_site_file_must_say_how_many_pulses_and_which_robot():
    six, options = (JointType.ROTARY,) * 6, HSES["options"]
    for wrong in (replace(options, pulses_per_degree=()), replace(options, group="S1")):
        with pytest.raises(GatewaySettingsError, match="yaskawa motion"):
            hses_driver(six, {}, relay=None, options=wrong)
    reads = hses_driver(six, {}, relay=None, options=replace(options, motion=False))
    assert not isinstance(reads, HsesMotionDriver)
    assert not reads.capabilities.commands
