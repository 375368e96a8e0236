"""Motion that is uncommanded, begins late, is refused, or continues after a stop."""

import asyncio
import contextlib
import time

import pytest

from robomesh.schemas import robomesh_pb2 as schema
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, refusal, until
from tests.protocol_gateway.scripted_controller import repeated, scripted_controller, slow_starter


async def test_uncommanded_motion_is_reported_and_ends_the_lease(mesh, tmp_path):
    waist = 0.0
    async with contextlib.AsyncExitStack() as stack:
        port, say, _ = await stack.enter_async_context(scripted_controller())
        await stack.enter_async_context(repeated(say, lambda: f"1#ABSOLUTE.DEG*{waist};90;-90;0;0@"))
        site = await stack.enter_async_context(gateway(mesh, tmp_path, port))
        await site.lease(A.ACQUIRE)
        await asyncio.sleep(0.3)
        await until(lambda: site.seen["lease"][-1].holder == "li")
        waist = 5.0
        await until(lambda: site.events("motion.foreign"))
        await until(lambda: not site.seen["lease"][-1].holder)
        assert not site.events("stop.latched")


@pytest.mark.parametrize("ttl_s", [0.5, 1.0])
async def test_the_dead_man_stop_is_sent_at_the_end_of_the_lease(mesh, tmp_path, ttl_s):
    async with scripted_controller() as (port, say, heard):
        status = "2#ABSOLUTE.DEG*1;90;-90;0;0&STATUS*moving;remote;homed@"
        async with repeated(say, lambda: status), gateway(mesh, tmp_path, port) as site:
            await site.lease(A.ACQUIRE, ttl_s=ttl_s)
            await site.command(C.MOVE_ABSOLUTE, joint_positions=[0, 1.5, -1.5, 0, 0])
            renewed = await site.lease(A.RENEW, ttl_s=ttl_s)
            until_s = renewed.until.ToNanoseconds() * 1e-9
            await until(lambda: b"stop" in heard)
            assert time.time() > until_s - 0.005


async def test_a_robot_that_ignores_repeated_stops_is_a_critical_event(mesh, tmp_path):
    async with scripted_controller() as (port, say, heard):
        status = "2#ABSOLUTE.DEG*1;90;-90;0;0&STATUS*moving;remote;homed@"
        async with repeated(say, lambda: status), gateway(mesh, tmp_path, port) as site:
            pressed = 0
            while not (disobeyed := site.events("stop.disobeyed")):
                await site.stop()
                pressed += 1
                await asyncio.sleep(0.3)
            assert disobeyed[0].severity == schema.Event.CRITICAL
            # Each time, the gateway repeats its stop.
            await until(lambda: heard.count(b"stop") == pressed + len(site.events("stop.disobeyed")))


async def test_a_motion_that_begins_late_stays_under_its_lease_and_is_stopped_with_it(mesh, tmp_path):
    async with slow_starter(2.6) as (port, heard), gateway(mesh, tmp_path, port) as site:
        await site.lease(A.ACQUIRE)
        await site.command(C.MOVE_ABSOLUTE, joint_positions=[1.0, 0, 0, 0, 0])
        await until(lambda: site.controller.activity == STATE.MOVING)
        await until(lambda: site.seen["lease"][-1].motion)
        assert not site.events("motion.foreign")
        await site.lease(A.RELEASE)
        await until(lambda: b"stop" in heard)


async def test_a_lease_that_ends_before_its_motion_has_begun_stops_the_robot(mesh, tmp_path):
    async with slow_starter(60.0) as (port, heard), gateway(mesh, tmp_path, port) as site:
        await site.lease(A.ACQUIRE)
        await site.command(C.MOVE_ABSOLUTE, joint_positions=[1.0, 0, 0, 0, 0])
        await asyncio.sleep(2.2)
        await site.lease(A.RELEASE)
        await until(lambda: b"stop" in heard)


async def test_a_motion_that_the_controller_refuses_is_over_at_once(mesh, tmp_path):
    async with (
        scripted_controller() as (port, say, heard),
        repeated(say, lambda: "2#ABSOLUTE.DEG*0;0;0;0;0&STATUS*idle;remote;homed@"),
        gateway(mesh, tmp_path, port) as site,
    ):
        await site.lease(A.ACQUIRE)
        await site.command(C.MOVE_ABSOLUTE, joint_positions=[1.0, 0, 0, 0, 0])
        await until(lambda: site.seen["lease"][-1].motion)
        say("1#ERROR*5;no@")
        await until(lambda: not site.seen["lease"][-1].motion)
        await site.lease(A.RELEASE)
        await until(lambda: not site.seen["lease"][-1].holder)
        assert b"stop" not in heard


async def test_a_refusal_of_an_earlier_unit_does_not_end_the_motion(mesh, tmp_path):
    async with (
        scripted_controller() as (port, say, heard),
        repeated(say, lambda: "2#ABSOLUTE.DEG*0;0;0;0;0&STATUS*idle;remote;homed@"),
        gateway(mesh, tmp_path, port) as site,
    ):
        await site.lease(A.ACQUIRE)
        await site.command(C.SPEED, speed_percent=50)
        await site.command(C.MOVE_ABSOLUTE, joint_positions=[1.0, 0, 0, 0, 0])
        say("1#ERROR*5;speed@")
        await until(lambda: site.events("controller.refused"))
        await site.lease(A.RELEASE)
        await until(lambda: b"stop" in heard)


async def test_a_stop_is_not_reset_during_motion_and_the_dead_man_stays(mesh, tmp_path):
    activity = "moving"

    def state():
        return f"2#ABSOLUTE.DEG*0;0;0;0;0&STATUS*{activity};remote;homed@"

    async with (
        scripted_controller() as (port, say, _),
        repeated(say, state),
        gateway(mesh, tmp_path, port) as site,
    ):
        await site.lease(A.ACQUIRE)
        await until(lambda: site.controller.activity == STATE.MOVING)
        stop_id = (await site.stop()).stop_id
        text = await refusal(site.command(C.RESET, stop_id=stop_id))
        assert text == (
            f"Not sent: the robot is still moving after stop {stop_id}: "
            "wait until it has stopped, then send RESET."
        )
        assert site.controller.stop.id == stop_id
        activity = "idle"
        await until(lambda: site.controller.activity == STATE.IDLE)
        await site.command(C.RESET, stop_id=stop_id)
        await until(lambda: not site.controller.HasField("stop"))


async def test_after_a_reset_the_old_stop_is_ignored_briefly_but_not_a_new_fault(mesh, tmp_path):
    activity = "stopped"

    def state():
        return f"2#ABSOLUTE.DEG*0;0;0;0;0&STATUS*{activity};remote;homed@"

    async with (
        scripted_controller() as (port, say, _),
        repeated(say, state),
        gateway(mesh, tmp_path, port) as site,
    ):
        await site.lease(A.ACQUIRE)
        await site.command(C.RESET)
        await site.command(C.HOME)
        await site.command(C.RESET)
        activity = "fault"
        await until(lambda: site.controller.activity == STATE.FAULT)
        assert "has a fault" in await refusal(site.command(C.HOME))
