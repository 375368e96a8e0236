"""Controllers that send too much, too little, in pieces, or garbage: state, event, recovery."""

import asyncio
import math
import time

from robomesh.contract.keys import robot_key
from tests.protocol_gateway.faulty_site import faulty_site
from tests.protocol_gateway.gateway_site import (
    PROMPT,
    STATE,
    A,
    C,
    gateway,
    kept_control,
    none_left_out,
    refusal,
    simulator,
    until,
)
from tests.protocol_gateway.old_client import legacy, program
from tests.protocol_gateway.scripted_controller import repeated, scripted_controller


async def test_a_controller_with_another_joint_count_is_silent_and_recovers(mesh, tmp_path):
    async with faulty_site(mesh, tmp_path) as (site, fault):
        await fault("joints")
        await until(lambda: site.controller.link == STATE.SILENT)
        assert "sends 6 joint values, the description has 5" in site.controller.link_text
        joints = len(site.seen["joints"])
        malformed = len(site.events("unit.malformed"))
        await site.lease(A.ACQUIRE)
        assert "the description has 5" in await refusal(site.command(C.HOME))
        # Longer than the reconnect timeout of a silent controller.
        await asyncio.sleep(4.5)
        await until(lambda: len(site.events("controller.joint_count")) == 1)
        assert len(site.events("unit.malformed")) == malformed
        assert len(site.seen["joints"]) == joints
        assert site.controller.counters.connections == 1
        await fault("joints", off=True)
        await until(lambda: site.controller.link == STATE.UP)


async def test_a_restart_with_another_joint_count_is_detected(mesh, tmp_path):
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


STATE_5 = "2#ABSOLUTE.DEG*{:.2f};0;0;0;0&STATUS*{};remote;homed@"
STATE_6 = "2#ABSOLUTE.DEG*0;0;0;0;0;0&STATUS*idle;remote;homed@"


async def test_one_unit_of_another_joint_count_invalidates_the_positions(mesh, tmp_path):
    async with (
        scripted_controller() as (port, say, heard),
        gateway(mesh, tmp_path, port, up=False, **PROMPT) as site,
        repeated(say, lambda: STATE_5.format(0, "idle")),
    ):
        await until(lambda: site.controller.link == STATE.UP)
        await site.lease(A.ACQUIRE)
        # A single one, as a second program of the controller may send.
        say(STATE_6)
        await until(lambda: site.controller.link == STATE.SILENT)
        text = await refusal(site.command(C.MOVE_ABSOLUTE, joint_positions=[0.3, 0, 0, 0, 0]))
        assert "sends 6 joint values, the description has 5" in text
        assert "the description has 5" in await refusal(site.command(C.HOME))
        assert heard == b""
        # No motion ran, so nothing is stopped; positions that return for a while are used again.
        await until(lambda: site.controller.link == STATE.UP)
        assert not site.controller.HasField("stop")
        await site.lease(A.RENEW)
        await site.command(C.MOVE_ABSOLUTE, joint_positions=[0.3, 0, 0, 0, 0])
        await until(lambda: b"ABSOLUTE.DEG" in heard)


async def test_a_changed_joint_count_stops_a_motion(mesh, tmp_path):
    async with (
        scripted_controller() as (port, say, heard),
        gateway(mesh, tmp_path, port, up=False, **PROMPT) as site,
    ):
        waist = 0.0

        def state():
            nonlocal waist
            waist += 0.1 if b"ABSOLUTE" in heard else 0.0
            return STATE_5.format(waist, "moving" if waist else "idle")

        async with repeated(say, state):
            await until(lambda: site.controller.link == STATE.UP)
            await site.lease(A.ACQUIRE)
            await site.command(C.MOVE_ABSOLUTE, joint_positions=[1.0, 0, 0, 0, 0])
            await until(lambda: site.controller.activity == STATE.MOVING)
            say(STATE_6)
            await until(lambda: b"COMMAND*stop" in heard)
        await until(lambda: site.controller.HasField("stop"))
        reason = site.controller.stop.reason
        assert reason.startswith("the link was lost during a motion of li: 127.0.0.1:")
        assert reason.endswith("sends 6 joint values, the description has 5")


async def test_an_arm_that_is_elsewhere_for_good_ends_control_and_is_shown_there(mesh, tmp_path):
    waist = 0.0
    async with (
        scripted_controller() as (port, say, heard),
        gateway(mesh, tmp_path, port, up=False, **PROMPT) as site,
        repeated(say, lambda: STATE_5.format(waist, "idle")),
    ):
        await until(lambda: site.controller.activity == STATE.IDLE)
        await site.lease(A.ACQUIRE)
        await asyncio.sleep(1.0)  # its activity counts only after a while
        waist = 60.0
        await until(lambda: site.controller.link == STATE.SILENT)
        assert "joint waist at 60.00° only" in site.controller.link_text
        async with kept_control(site):
            await until(lambda: site.events("motion.foreign"))
        await until(lambda: site.seen["lease"][-1].holder == "")
        assert site.controller.link == STATE.UP
        assert len(site.events("controller.joint_values")) == 1
        await until(lambda: abs(site.joints[0] - math.radians(60.0)) < 1e-6)
        # No motion ran: nothing is stopped, and nothing was shown between.
        assert heard == b""
        assert {each.joints[0].position for each in site.seen["joints"]} == {0.0, math.radians(60.0)}


async def test_one_impossible_unit_ends_no_control_and_is_not_shown(mesh, tmp_path):
    settings = legacy(commanders={})
    async with (
        scripted_controller() as (port, say, heard),
        gateway(mesh, tmp_path, port, up=False, **PROMPT, legacy_clients=settings) as site,
        repeated(say, lambda: STATE_5.format(0, "idle")),
    ):
        await until(lambda: site.controller.link == STATE.UP)
        await site.lease(A.ACQUIRE)
        async with kept_control(site), program(settings) as old:
            await until(lambda: old.positions)
            say(STATE_5.format(2_143_263, "idle"))
            await until(lambda: site.controller.link == STATE.SILENT)
            assert "joint waist at 2143263.00°, far beyond its limits" in site.controller.link_text
            assert "far beyond" in await refusal(
                site.command(C.MOVE_ABSOLUTE, joint_positions=[0.3, 0, 0, 0, 0])
            )
            await until(lambda: site.controller.link == STATE.UP)
            await site.units(100)
            assert site.seen["lease"][-1].holder == "li"
        assert not site.events("motion.foreign")
        assert site.controller.counters.units_malformed == 1
        assert {each.joints[0].position for each in site.seen["joints"]} == {0.0}
        assert set(old.positions) == {(0.0,) * 5}
        assert heard == b""


async def test_an_arm_a_little_outside_its_soft_limits_is_shown(mesh, tmp_path):
    async with (
        scripted_controller() as (port, say, _),
        gateway(mesh, tmp_path, port, up=False, **PROMPT) as site,
        repeated(say, lambda: STATE_5.format(150.5, "idle")),
    ):
        await until(lambda: site.controller.link == STATE.UP)
        await site.units(20)
        assert abs(site.joints[0] - math.radians(150.5)) < 1e-6


async def test_a_far_arm_is_silent_without_a_message_for_each_unit(mesh, tmp_path):
    waist = 180.0

    def state():
        nonlocal waist
        waist += 0.1
        return STATE_5.format(waist, "idle")

    async with (
        scripted_controller() as (port, say, _),
        gateway(mesh, tmp_path, port, up=False, **PROMPT) as site,
        repeated(say, state),
    ):
        await until(
            lambda: site.controller.link == STATE.SILENT and "far beyond" in site.controller.link_text
        )
        before, units = len(site.seen["controller"]), site.controller.counters.units_received
        await until(lambda: site.controller.counters.units_received > units + 300)
        assert len(site.seen["controller"]) - before < 30
        assert len(site.events("controller.joint_values")) == 1
        assert not site.seen["joints"]
        assert site.controller.counters.connections == 1


async def test_of_a_flood_the_newest_is_published_and_other_robots_keep_their_rate(mesh, tmp_path):
    async with simulator(demo=True) as other, faulty_site(mesh, tmp_path, other) as (site, fault):
        await fault("flood")
        await until(lambda: site.events("link.flooding"))
        await until(lambda: site.controller.health.flooding)
        calm = site.session.subscribe(robot_key("hall", "arm-2", "joints"), newest=1000)
        await anext(calm)
        flooded = len(site.seen["joints"])
        for _ in range(200):
            await anext(calm)
        await until(lambda: len(site.seen["joints"]) > flooded + 100)
        stamps_ns = [each.timestamp.ToNanoseconds() for each in site.seen["joints"][flooded:]]
        assert len(stamps_ns) - 1 < 250 * (stamps_ns[-1] - stamps_ns[0]) * 1e-9
        assert await none_left_out(site.session, calm, "arm-2")
        assert site.controller.counters.units_skipped > 1000
        assert site.controller.link == STATE.UP
        await fault("flood", off=True)
        # One event each time: a busy simulator floods by turns.
        begun, ended = "link.flooding", "link.flooding_ended"
        await until(lambda: len(site.events(begun)) == len(site.events(ended)) < 10)
        await until(lambda: not site.controller.health.flooding)


async def test_a_flood_does_not_reach_old_client_programs(mesh, tmp_path):
    settings = legacy(commanders={})
    sites = faulty_site(mesh, tmp_path, legacy_clients=settings)
    async with sites as (site, fault), program(settings) as one:
        await fault("flood")
        await until(lambda: site.events("link.flooding"))
        begin_s, before = time.monotonic(), len(one.units)
        await asyncio.sleep(1.0)
        sent = len(one.units) - before
        assert 0 < sent < 400 * (time.monotonic() - begin_s)


async def test_a_deluge_is_discarded_until_it_ends(mesh, tmp_path):
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


async def test_units_in_pieces_are_units(mesh, tmp_path):
    async with faulty_site(mesh, tmp_path) as (site, fault):
        await fault("split")
        before = len(site.seen["joints"])
        await until(lambda: len(site.seen["joints"]) > before + 30)
        assert site.controller.counters.units_malformed == 0
        assert site.controller.link == STATE.UP


async def test_garbage_between_units_is_reported_at_a_limited_rate_and_counted(mesh, tmp_path):
    async with faulty_site(mesh, tmp_path) as (site, fault):
        await fault("garbage")
        await until(lambda: site.controller.counters.units_malformed > 25)
        events = site.events("unit.malformed")
        assert 5 <= len(events) < site.controller.counters.units_malformed
        assert events[0].values["offset"]
        assert all(len(event.values["bytes"]) <= 260 for event in events)
        assert len(site.seen["joints"]) > 20
        await fault("garbage", off=True)
        await until(lambda: site.controller.link == STATE.UP)


async def test_a_missing_status_is_unknown_until_it_returns(mesh, tmp_path):
    async with faulty_site(mesh, tmp_path, demo=False) as (site, fault):
        await until(lambda: site.controller.mode == STATE.REMOTE)
        await site.units(8)  # its status is seen to repeat
        await fault("mute")
        await until(lambda: site.events("status.gone"))
        await until(lambda: site.controller.mode == STATE.MODE_UNKNOWN)
        assert site.controller.homed == STATE.UNKNOWN
        assert site.controller.link == STATE.UP
        await site.lease(A.ACQUIRE)
        assert "does not report whether" in await refusal(site.command(C.HOME))
        await fault("mute", off=True)
        await until(lambda: site.controller.mode == STATE.REMOTE)


async def test_a_controller_with_positions_only_has_an_unknown_status(mesh, tmp_path):
    async with faulty_site(mesh, tmp_path) as (site, fault):
        await site.units(8)  # its status is seen to repeat
        await fault("bare")
        await until(lambda: site.controller.mode == STATE.MODE_UNKNOWN)
        assert site.controller.activity == STATE.ACTIVITY_UNKNOWN
        assert not any(joint.HasField("velocity") for joint in site.seen["joints"][-1].joints)
        before = len(site.seen["joints"])
        await until(lambda: len(site.seen["joints"]) > before + 20)
        assert site.controller.link == STATE.UP
