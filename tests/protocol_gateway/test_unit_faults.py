"""Controllers that send too much, too little, in pieces or something else: state, event, recovery."""

import asyncio
import time

from robomesh.keys import robot_key
from tests.conftest import run
from tests.protocol_gateway.faulty_site import faulty_site
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, none_left_out, refusal, simulator, until
from tests.protocol_gateway.old_client import legacy, program
from tests.protocol_gateway.scripted_controller import repeated, scripted_controller


def test_a_controller_with_another_joint_count_is_silent_says_why_once_and_comes_back(mesh, tmp_path):
    async def main():
        async with faulty_site(mesh, tmp_path) as (site, fault):
            await fault("joints")
            await until(lambda: site.controller.link == STATE.SILENT)
            assert "sends 6 joint values, the description has 5" in site.controller.link_text
            joints = len(site.seen["joints"])
            malformed = len(site.events("unit.malformed"))
            await site.lease(A.ACQUIRE)
            assert "the description has 5" in await refusal(site.command(C.HOME))
            # Longer than the link waits for a controller that sends nothing.
            await asyncio.sleep(4.5)
            await until(lambda: len(site.events("controller.joint_count")) == 1)
            assert len(site.events("unit.malformed")) == malformed
            assert len(site.seen["joints"]) == joints
            assert site.controller.counters.connections == 1
            await fault("joints", off=True)
            await until(lambda: site.controller.link == STATE.UP)

    run(main())


def test_a_controller_that_restarts_with_another_joint_count_is_never_taken_for_the_old_one(mesh, tmp_path):
    async def main():
        async with faulty_site(mesh, tmp_path) as (site, fault):
            await fault("restart")
            await fault("joints")
            await until(lambda: site.controller.link == STATE.DOWN)
            joints = len(site.seen["joints"])
            await until(lambda: "sends 6 joint values" in site.controller.link_text)
            assert site.controller.link == STATE.SILENT
            await until(lambda: site.events("controller.joint_count"))
            await until(lambda: len(site.events("controller.joint_count")) == 1)
            assert not site.events("unit.malformed")
            assert len(site.seen["joints"]) == joints
            await fault("joints", off=True)
            await until(lambda: site.controller.link == STATE.UP)

    run(main())


STATE_5 = "2#ABSOLUTE.DEG*{:.2f};0;0;0;0&STATUS*{};remote;homed@"
STATE_6 = "2#ABSOLUTE.DEG*0;0;0;0;0;0&STATUS*idle;remote;homed@"


def test_one_unit_of_another_joint_count_invalidates_the_positions_and_a_motion_behind_it_is_refused(
    mesh, tmp_path
):
    async def main():
        async with (
            scripted_controller() as (port, say, heard),
            gateway(mesh, tmp_path, port, up=False) as site,
            repeated(say, lambda: STATE_5.format(0, "idle")),
        ):
            await until(lambda: site.controller.link == STATE.UP)
            await site.lease(A.ACQUIRE, ttl_s=5)
            # One among all the others, as a controller's second program may send it.
            say(STATE_6)
            await until(lambda: site.controller.link == STATE.SILENT)
            text = await refusal(site.command(C.MOVE_ABSOLUTE, joint_positions=[0.3, 0, 0, 0, 0]))
            assert "sends 6 joint values, the description has 5" in text
            assert "the description has 5" in await refusal(site.command(C.HOME))
            assert heard == b""
            # No motion ran, so nothing is stopped; and what comes again for a while counts again.
            await until(lambda: site.controller.link == STATE.UP)
            assert not site.controller.HasField("stop")
            await site.lease(A.RENEW, ttl_s=5)
            await site.command(C.MOVE_ABSOLUTE, joint_positions=[0.3, 0, 0, 0, 0])
            await until(lambda: b"ABSOLUTE.DEG" in heard)

    run(main())


def test_a_motion_that_runs_when_the_joint_count_changes_is_stopped_as_at_a_lost_link(mesh, tmp_path):
    async def main():
        async with (
            scripted_controller() as (port, say, heard),
            gateway(mesh, tmp_path, port, up=False) as site,
        ):
            waist = 0.0

            def state():
                nonlocal waist
                waist += 0.1 if b"ABSOLUTE" in heard else 0.0
                return STATE_5.format(waist, "moving" if waist else "idle")

            async with repeated(say, state):
                await until(lambda: site.controller.link == STATE.UP)
                await site.lease(A.ACQUIRE, ttl_s=5)
                await site.command(C.MOVE_ABSOLUTE, joint_positions=[1.0, 0, 0, 0, 0])
                await until(lambda: site.controller.activity == STATE.MOVING)
                say(STATE_6)
                await until(lambda: b"COMMAND*stop" in heard)
            await until(lambda: site.controller.HasField("stop"))
            reason = site.controller.stop.reason
            assert reason.startswith("li's motion ran, and 127.0.0.1:")
            assert reason.endswith("sends 6 joint values, the description has 5")

    run(main())


def test_of_a_flood_the_newest_is_published_the_rest_counted_and_another_robot_keeps_its_rate(mesh, tmp_path):
    async def main():
        async with simulator(demo=True) as other, faulty_site(mesh, tmp_path, other) as (site, fault):
            await fault("flood")
            await until(lambda: site.events("link.flooding"))
            await until(lambda: site.controller.health.flooding)
            calm = site.session.subscribe(robot_key("hall", "arm-2", "joints"), newest=1000)
            await anext(calm)
            begin_s, flooded = time.monotonic(), len(site.seen["joints"])
            for _ in range(200):
                await anext(calm)
            elapsed_s = time.monotonic() - begin_s
            assert len(site.seen["joints"]) - flooded < 250 * elapsed_s
            assert await none_left_out(site.session, calm, "arm-2")
            assert site.controller.counters.units_skipped > 1000
            assert site.controller.link == STATE.UP
            await fault("flood", off=True)
            await until(lambda: site.events("link.flooding_ended"))
            await until(lambda: not site.controller.health.flooding)
            await until(lambda: len(site.events("link.flooding")) == 1)

    run(main())


def test_a_flood_does_not_reach_old_client_programs(mesh, tmp_path):
    async def main():
        settings = legacy(commanders={})
        sites = faulty_site(mesh, tmp_path, legacy_clients=settings)
        async with sites as (site, fault), program(settings) as one:
            await fault("flood")
            await until(lambda: site.events("link.flooding"))
            begin_s, before = time.monotonic(), len(one.units)
            await asyncio.sleep(1.0)
            told = len(one.units) - before
            assert 0 < told < 400 * (time.monotonic() - begin_s)

    run(main())


def test_of_a_controller_that_sends_more_than_can_be_read_nothing_is_taken_until_it_sends_less(
    mesh, tmp_path
):
    async def main():
        async with faulty_site(mesh, tmp_path) as (site, fault):
            await fault("deluge")
            await until(lambda: site.events("link.deluge"))
            await until(lambda: site.controller.link == STATE.SILENT)
            assert (await site.stop(by="wang")).sent
            await fault("deluge", off=True)
            await until(lambda: site.controller.link == STATE.UP, timeout_s=20.0)
            await until(lambda: site.controller.activity == STATE.STOPPED)
            before = len(site.seen["joints"])
            await until(lambda: len(site.seen["joints"]) > before + 20)
            assert site.controller.counters.connections == 1

    run(main(), timeout_s=60.0)


def test_units_in_pieces_are_units(mesh, tmp_path):
    async def main():
        async with faulty_site(mesh, tmp_path) as (site, fault):
            await fault("split")
            before = len(site.seen["joints"])
            await until(lambda: len(site.seen["joints"]) > before + 30)
            assert site.controller.counters.units_malformed == 0
            assert site.controller.link == STATE.UP

    run(main())


def test_garbage_between_units_is_said_a_few_times_and_counted_always(mesh, tmp_path):
    async def main():
        async with faulty_site(mesh, tmp_path) as (site, fault):
            await fault("garbage")
            await until(lambda: site.controller.counters.units_malformed > 25)
            told = site.events("unit.malformed")
            assert 5 <= len(told) < site.controller.counters.units_malformed
            assert told[0].values["offset"]
            assert all(len(event.values["bytes"]) <= 260 for event in told)
            assert len(site.seen["joints"]) > 20
            await fault("garbage", off=True)
            await until(lambda: site.controller.link == STATE.UP)

    run(main())


def test_a_status_that_comes_no_more_is_not_known_any_more_and_is_again_when_it_comes(mesh, tmp_path):
    async def main():
        async with faulty_site(mesh, tmp_path, demo=False) as (site, fault):
            await until(lambda: site.controller.mode == STATE.REMOTE)
            await asyncio.sleep(0.1)  # its status is seen to come again and again
            await fault("mute")
            await until(lambda: site.events("status.gone"))
            await until(lambda: site.controller.mode == STATE.MODE_UNKNOWN)
            assert site.controller.homed == STATE.UNKNOWN
            assert site.controller.link == STATE.UP
            await site.lease(A.ACQUIRE, ttl_s=5)
            assert "does not tell whether" in await refusal(site.command(C.HOME))
            await fault("mute", off=True)
            await until(lambda: site.controller.mode == STATE.REMOTE)

    run(main())


def test_a_controller_that_tells_only_positions_is_shown_and_the_rest_is_unknown(mesh, tmp_path):
    async def main():
        async with faulty_site(mesh, tmp_path) as (site, fault):
            await asyncio.sleep(0.1)  # its status is seen to come again and again
            await fault("bare")
            await until(lambda: site.controller.mode == STATE.MODE_UNKNOWN)
            assert site.controller.activity == STATE.ACTIVITY_UNKNOWN
            assert not any(joint.HasField("velocity") for joint in site.seen["joints"][-1].joints)
            before = len(site.seen["joints"])
            await until(lambda: len(site.seen["joints"]) > before + 20)
            assert site.controller.link == STATE.UP

    run(main())
