"""Scenarios within a motion, each tried with every driver that moves a robot (`movers`).

CONTRIBUTING.md says how to read the table of scenarios and drivers.
"""

import asyncio
import contextlib
import itertools
import re
import signal
import time
from pathlib import Path

import pytest

from protocol_gateway.checking.checker import Checker
from tests.conftest import run
from tests.controllers.movers import ANY, MOVERS, NOT_NOW, UnitMover, every_mover
from tests.protocol_gateway.gateway_site import (
    STATE,
    A,
    codes_of,
    gateway_process,
    kept_control,
    refusal,
    stopped_for,
    until,
    watching,
)

pytestmark = pytest.mark.slow
QUICK = {"stale_after_s": 1.5, "reconnect_after_s": 3.0}


def id_of(value):
    return value if isinstance(value, str) else value.name


def near(here, there):
    return all(abs(a - b) < 1e-3 for a, b in zip(here, there, strict=True))


async def rests_for_good(arm, *, motions=1):
    """Wait until the arm rests; assert that it stays at rest, and what was sent so far."""
    await until(lambda: not arm.moves())
    rest = arm.positions()
    await until(lambda: arm.site.controller.link == STATE.UP)
    await arm.site.units(10)
    assert near(arm.positions(), rest)
    judge(arm, motions)


def judge(arm, motions=1):
    """Assert on the wire that only declared commands were sent, and this many motions."""
    assert arm.motions == motions
    assert set(arm.words()) <= arm.allowed


async def is_stopped(arm, scenario):
    """Wait until a stop is latched, for the cause that the driver has for a scenario."""
    if scenario in arm.causes:
        await stopped_for(arm.site, arm.causes[scenario])
    else:
        await until(lambda: arm.site.controller.HasField("stop"))


def stops(arm):
    return arm.site.controller.capabilities.stops


@every_mover("done")
async def test_motions_end_at_their_targets_and_nothing_else_is_sent(mesh, tmp_path, monkeypatch, mover):
    async with mover.started(mesh, tmp_path, monkeypatch) as arm:
        await arm.in_control()
        async with kept_control(arm.site):
            for by in (0.1, -0.1, 0.1):
                target = await arm.moved(by)
                await until(lambda target=target: near(arm.positions(), target))
            await until(lambda: arm.site.controller.activity == STATE.IDLE)
            await rests_for_good(arm, motions=3)
        assert near(arm.positions(), target)
        assert not arm.site.controller.HasField("stop")
        assert stops(arm) == arm.stops
        declared = {True: STATE.YES, False: STATE.NO, None: STATE.UNKNOWN}[arm.dies_with_link]
        assert arm.site.controller.capabilities.dies_with_link == declared


@every_mover("stop")
async def test_a_stop_ends_the_motion_for_good_and_its_reset_moves_nothing(
    mesh, tmp_path, monkeypatch, mover
):
    async with mover.started(mesh, tmp_path, monkeypatch) as arm:
        target = await arm.begin()
        assert (await arm.site.stop(by="wang")).sent
        await rests_for_good(arm)
        assert abs(arm.positions()[0] - target[0]) > 0.3
        assert "stop 1 is latched" in await refusal(arm.move(0.1))
        async with kept_control(arm.site):
            await arm.reset()
            await rests_for_good(arm)
            await arm.moved(-0.1)
            await until(arm.moves)
            await rests_for_good(arm, motions=2)


@every_mover("local")
async def test_local_control_and_back_within_a_motion_never_continues_it(mesh, tmp_path, monkeypatch, mover):
    async with mover.started(mesh, tmp_path, monkeypatch) as arm:
        target = await arm.begin()
        arm.go_local()
        await until(lambda: arm.site.controller.mode == STATE.LOCAL)
        await until(lambda: stops(arm) == arm.local_stops)
        await arm.site.lease(A.RENEW)
        await until(lambda: arm.site.controller.HasField("stop"))
        allowed = {arm.causes.get("local"), "stop.went_local", "stop.fate_unknown"}
        assert codes_of(arm.site.controller.stop.why) & allowed
        if arm.local_stops == NOT_NOW:
            # The controller refuses the stop.
            await until(lambda: any("refuses" in each.text for each in arm.site.events("controller.alarm")))
            assert arm.moves()
        else:
            await until(lambda: not arm.moves())
        arm.go_remote()
        await until(lambda: arm.site.controller.mode == STATE.REMOTE)
        await rests_for_good(arm)
        await until(lambda: stops(arm) == arm.stops)
        assert abs(arm.positions()[0] - target[0]) > 0.3
        await arm.reset()
        target = await arm.moved(-0.1)
        await until(lambda: near(arm.positions(), target))


@pytest.mark.parametrize(
    ("mover", "hazard"), [(mover, each) for mover in MOVERS for each in mover.hazards], ids=id_of
)
async def test_what_others_do_within_a_motion_is_a_stop(mesh, tmp_path, monkeypatch, mover, hazard):
    async with mover.started(mesh, tmp_path, monkeypatch) as arm:
        target = await arm.begin()
        happens, ends, code = arm.hazards[hazard]
        await happens(arm)
        await stopped_for(arm.site, code)
        await until(lambda: not arm.moves())
        # Whatever ends the obstacle, the motion does not go on.
        ends(arm)
        await rests_for_good(arm)
        assert abs(arm.positions()[0] - target[0]) > 0.3


@every_mover("foreign")
async def test_a_program_of_others_between_motions_ends_control_and_the_stop_ends_it_if_declared(
    mesh, tmp_path, monkeypatch, mover
):
    async with mover.started(mesh, tmp_path, monkeypatch) as arm:
        target = await arm.begin(0.05)
        async with kept_control(arm.site):
            await until(lambda: near(arm.positions(), target))
            await until(lambda: not arm.site.seen["lease"][-1].motion)
            said = stops(arm)
            await arm.start_foreign()
            await until(lambda: arm.site.events("motion.foreign"))
        await until(lambda: arm.site.seen["lease"][-1].holder == "")
        # The gateway has stopped what may have been the holder's motion.
        await until(lambda: arm.site.controller.stop.sent)
        await a_stop_has_ended(arm, said)


@every_mover("foreign in local")
async def test_in_local_control_a_stop_ends_a_program_of_others_only_if_the_state_says_so(
    mesh, tmp_path, monkeypatch, mover
):
    async with mover.started(mesh, tmp_path, monkeypatch) as arm:
        await arm.in_control()
        await arm.start_foreign()
        await until(lambda: arm.site.events("motion.foreign"))
        await until(lambda: arm.site.seen["lease"][-1].holder == "")
        assert not arm.site.controller.HasField("stop")
        await until(lambda: arm.site.controller.activity == STATE.MOVING)
        await arm.site.units(20)
        await arm.site.lease(A.ACQUIRE)
        if not arm.replaces:
            await refusal(arm.move(0.1))
        arm.go_local()
        await until(lambda: arm.site.controller.mode == STATE.LOCAL)
        await until(lambda: stops(arm) == arm.local_stops)
        assert "local" in await refusal(arm.move(0.1))
        await arm.site.stop(by="wang")
        await a_stop_has_ended(arm, arm.local_stops, motions=0)


async def a_stop_has_ended(arm, said, *, motions=1):
    """Assert that a stop has ended a program of others, exactly if the state had said that it would."""
    if said != ANY:
        await arm.site.units(20)
        assert arm.foreign_runs()
        await arm.end_foreign()
    await rests_for_good(arm, motions=motions)


@every_mover("tool")
async def test_a_tool_changed_by_others_leaves_motions_unchecked_and_ends_one(
    mesh, tmp_path, monkeypatch, mover
):
    # Nothing is checked here: no process is needed.
    monkeypatch.setattr(Checker, "problem", lambda self, robot: None)
    async with mover.started(mesh, tmp_path / "first", monkeypatch, check="require") as arm:
        await arm.in_control()
        await until(lambda: not arm.site.controller.check_text)
        undo = arm.change_tool()
        await until(lambda: arm.site.controller.check_reason.code == "check.tool_changed")
        await arm.site.lease(A.RENEW)
        assert "were changed at the controller" in await refusal(arm.move(0.1))
        undo()
        await until(lambda: not arm.site.controller.check_text)
        judge(arm, motions=0)
    async with mover.started(mesh, tmp_path / "second", monkeypatch) as arm:
        target = await arm.begin()
        arm.change_tool()
        await is_stopped(arm, "tool")
        await rests_for_good(arm)
        assert abs(arm.positions()[0] - target[0]) > 0.3


@every_mover("corrupted")
async def test_one_corrupted_position_stops_the_motion_and_is_never_published(
    mesh, tmp_path, monkeypatch, mover
):
    async with mover.started(mesh, tmp_path, monkeypatch, **QUICK) as arm:
        target = await arm.begin()
        arm.corrupt()
        await until(lambda: arm.site.controller.HasField("stop"))
        event = await arm.site.event("controller.joint_values", 0)
        assert codes_of(event.reason) & {"joints.far", "joints.leap"}
        await rests_for_good(arm)
        assert abs(arm.positions()[0] - target[0]) > 0.3
        assert len(arm.site.events("controller.joint_values")) == 1
        furthest = max(abs(each.joints[0].position) for each in arm.site.seen["joints"])
        assert furthest < 4.0


@every_mover("override")
async def test_an_override_of_others_slows_the_motion_only(mesh, tmp_path, monkeypatch, mover):
    async with mover.started(mesh, tmp_path, monkeypatch) as arm:
        target = await arm.begin(0.15)
        await arm.slow_down()
        async with kept_control(arm.site):
            await until(lambda: near(arm.positions(), target))
            await rests_for_good(arm)
        assert not arm.site.controller.HasField("stop")


@every_mover("stop channel")
async def test_motion_needs_the_connection_of_its_stop(mesh, tmp_path, monkeypatch, mover):
    async with mover.started(mesh, tmp_path, monkeypatch, accept_unknown=frozenset({"mode"})) as arm:
        await arm.in_control()
        arm.cut_stop()
        await until(lambda: stops(arm) == NOT_NOW)
        assert arm.site.controller.link == STATE.UP
        await arm.site.lease(A.RENEW)
        assert "a stop could not be sent" in await refusal(arm.move(0.1))
        judge(arm, motions=0)
        await arm.mend_stop()
        target = await arm.begin()
        arm.cut_stop()
        await is_stopped(arm, "stop channel")
        await until(lambda: stops(arm) == NOT_NOW)
        assert arm.site.controller.link == STATE.UP
        await arm.mend_stop()
        await until(lambda: arm.site.controller.stop.sent)
        await rests_for_good(arm)
        assert abs(arm.positions()[0] - target[0]) > 0.3


@every_mover("late")
async def test_a_motion_that_arrives_after_its_stop_moves_nothing(mesh, tmp_path, monkeypatch, mover):
    async with mover.started(mesh, tmp_path, monkeypatch) as arm:
        await arm.in_control()
        release = arm.keep_back()
        here = arm.positions()
        await arm.moved(1.5)
        if not arm.watches:
            await arm.site.stop(by="wang")
        await is_stopped(arm, "late")
        release()
        await rests_for_good(arm)
        assert abs(arm.positions()[0] - here[0]) < 0.05


@every_mover("reply")
async def test_a_motion_whose_reply_is_lost_is_not_sent_again(mesh, tmp_path, monkeypatch, mover):
    async with mover.started(mesh, tmp_path, monkeypatch) as arm:
        await arm.in_control()
        await arm.lose_reply()
        target = await arm.moved(0.2)
        async with kept_control(arm.site):
            await until(lambda: near(arm.positions(), target))
            if "reply" in arm.causes:
                await is_stopped(arm, "reply")
            await rests_for_good(arm)


@pytest.mark.parametrize("way", ["cut", "half-open", "frozen"])
@every_mover("lost link")
async def test_a_lost_link_stops_the_motion_as_declared_and_never_sends_it_again(
    mesh, tmp_path, monkeypatch, mover, way
):
    async with mover.started(mesh, tmp_path, monkeypatch, **QUICK) as arm:
        target = await arm.begin(0.6 if arm.dies_with_link else 0.25)
        if way == "frozen":
            arm.fault("freeze")
        for each in arm.wires.values():
            if way == "cut":
                each.cut()
            each.swallows = way == "half-open"
        await until(lambda: arm.site.controller.HasField("stop"))
        await until(lambda: not arm.moves())
        assert near(arm.positions(), target) is not bool(arm.dies_with_link)
        before = arm.words().count("stop")
        if way == "frozen":
            arm.end_fault("freeze")
        for each in arm.wires.values():
            if way == "cut":
                await each.open()
            each.swallows = False
        # The latched stop is delivered. What a frozen controller has not read, it reads now.
        least = before if way == "frozen" else before + 1
        await until(lambda: arm.site.controller.stop.sent and arm.words().count("stop") >= least)
        await rests_for_good(arm)


@every_mover("restart")
async def test_a_restart_of_the_controller_within_a_motion_is_a_stop(mesh, tmp_path, monkeypatch, mover):
    async with mover.started(mesh, tmp_path, monkeypatch, **QUICK) as arm:
        await arm.begin()
        before = arm.arm
        arm.fault("restart+0.3")
        await until(lambda: arm.site.controller.HasField("stop"))
        await until(lambda: arm.arm is not before)
        await until(lambda: arm.site.controller.stop.sent)
        await rests_for_good(arm)
        # The controller's clock begins again; the stamps go on.
        stamps = [each.timestamp.ToNanoseconds() for each in arm.site.seen["joints"]]
        assert stamps == sorted(stamps)
        await until(lambda: stops(arm) != NOT_NOW)


@every_mover("seat")
async def test_a_taken_seat_is_named_and_forbids_motion(mesh, tmp_path, monkeypatch, mover):
    async with mover.started(mesh, tmp_path, monkeypatch, prepare=mover.take_seat, up=False) as arm:
        site = arm.site
        await until(lambda: site.seen.get("controller"))
        await site.lease(A.ACQUIRE)
        await until(lambda: any(arm.seat in each.text for each in site.seen["events"]))
        await site.lease(A.RENEW)
        await refusal(arm.move(0.1))
        judge(arm, motions=0)
        arm.free_seat()
        async with kept_control(site):
            target = await arm.moved(0.05)
            await until(lambda: near(arm.positions(), target))
        await rests_for_good(arm)


@every_mover("fault")
async def test_a_fault_of_the_controller_ends_the_motion_for_good(mesh, tmp_path, monkeypatch, mover):
    async with mover.started(mesh, tmp_path, monkeypatch) as arm:
        target = await arm.begin()
        arm.fault("fault")
        if arm.watches:
            await is_stopped(arm, "fault")
        shown = arm.fault_is_shown_as
        await until(lambda: arm.site.controller.activity == shown)
        await until(lambda: not arm.moves())
        await arm.site.lease(A.RENEW)
        await refusal(arm.move(0.1))
        arm.end_fault("fault")
        await until(lambda: arm.site.controller.activity != shown)
        await rests_for_good(arm)
        assert abs(arm.positions()[0] - target[0]) > 0.3


@every_mover("stop of others")
async def test_a_stop_by_another_client_of_the_controller_ends_the_motion(mesh, tmp_path, monkeypatch, mover):
    async with mover.started(mesh, tmp_path, monkeypatch) as arm:
        target = await arm.begin()
        await arm.stop_elsewhere()
        await rests_for_good(arm)
        assert abs(arm.positions()[0] - target[0]) > 0.3
        # The operator is told.
        if "stop of others" in arm.causes:
            await is_stopped(arm, "stop of others")
        else:
            shown = arm.site.events("controller.alarm")
            await until(lambda: shown or arm.site.controller.activity == STATE.STOPPED)


@pytest.mark.parametrize(
    ("way", "delays", "copies"),
    [
        ("late", (0.4, 0.0, 0.0, 0.0), 1),
        ("doubled", (0.0,), 2),
        ("reordered", (0.05, 0.0, 0.02, 0.0), 1),
    ],
    ids=["late", "doubled", "reordered"],
)
@every_mover("datagrams")
async def test_datagrams_that_the_network_disturbs_move_the_arm_once(
    mesh, tmp_path, monkeypatch, mover, way, delays, copies
):
    async with mover.started(mesh, tmp_path, monkeypatch) as arm:
        await arm.in_control()
        for each in arm.wires.values():
            each.delays = itertools.cycle(delays)
            each.commands = each.answers = lambda data: [data] * copies
        async with kept_control(arm.site):
            target = await arm.moved(0.2)
            await until(lambda: near(arm.positions(), target))
            await rests_for_good(arm)
        assert arm.arm.commands == 1
        assert not arm.site.controller.HasField("stop")


@every_mover("axes")
async def test_other_axes_after_a_restart_forbid_motion(mesh, tmp_path, monkeypatch, mover):
    impatient = {"stale_after_s": 0.4, "reconnect_after_s": 0.6}
    async with mover.started(mesh, tmp_path, monkeypatch, **impatient) as arm:
        await arm.in_control()
        before = arm.arm
        arm.fault("restart+0.9")
        arm.fault("joints")
        await until(lambda: arm.site.controller.link != STATE.UP)
        await until(lambda: arm.arm is not before)
        arm.arm._servo_on = True
        async with kept_control(arm.site), asyncio.timeout(30.0):
            while not re.search("axis|axes|joint values", await refusal(arm.move(0.1))):
                await asyncio.sleep(0.05)
        judge(arm, motions=0)


@contextlib.asynccontextmanager
async def watched(mover, mesh, monkeypatch):
    """Yield an arm for a gateway in another process."""
    async with mover.wired(monkeypatch) as (server, wires), watching(mesh, mover.name) as site:
        yield mover(site, wires, server)


async def all_in_control(arms):
    for arm in arms:
        await until(lambda arm=arm: arm.site.joints, timeout_s=60.0)
        await arm.in_control()


async def all_crawl(arms):
    await asyncio.gather(*(each.crawl() for each in arms))
    # A gateway that a busy machine holds up for 0.1 s has its arm stopped, too.
    while resting := [each for each in arms if not each.moves()]:
        await asyncio.gather(*(each.crawl() for each in resting))


async def time_to_rest(arm):
    """Return the time until the arm rests, and the longest time that the controller's event loop was late."""
    began_s = before_s = time.monotonic()
    late_s = 0.0
    while arm.moves():
        await asyncio.sleep(0.001)
        late_s, before_s = max(late_s, time.monotonic() - before_s), time.monotonic()
    return before_s - began_s, late_s


@pytest.mark.processes
def test_a_killed_gateway_leaves_its_motions_as_declared_and_the_next_one_ends_them(
    mesh, tmp_path, monkeypatch
):
    """A controller with a dead man stops its arm; the others' arms move on, until the next gateway."""

    async def main():
        async with contextlib.AsyncExitStack() as stack:
            arms = [await stack.enter_async_context(watched(mover, mesh, monkeypatch)) for mover in MOVERS]
            robots = [each.settings() for each in arms]
            async with gateway_process(mesh, tmp_path, robots) as process:
                await all_in_control(arms)
                async with kept_control(*(each.site for each in arms)):
                    await all_crawl(arms)
                    process.kill()
                    for arm in arms:
                        if arm.dies_with_link:
                            rest_s, late_s = await time_to_rest(arm)
                            print(f"{arm.name}: at rest {rest_s:.3f} s after the kill")
                            assert rest_s < 0.2 + 2 * late_s
                    await process.wait()
            sent = [each.motions for each in arms]
            before = [each.positions()[0] for each in arms]
            for arm, here in zip(arms, before, strict=True):
                if not arm.dies_with_link:
                    await until(lambda arm=arm, here=here: abs(arm.positions()[0] - here) > 0.02)
                    assert arm.moves()
            async with gateway_process(mesh, tmp_path, robots):
                for arm in arms:
                    await until(lambda arm=arm: not arm.moves(), timeout_s=60.0)
                    await arm.site.units(5)
            for arm, number in zip(arms, sent, strict=True):
                assert not arm.moves()
                judge(arm, motions=number)
                assert arm.words().count("stop") or arm.dies_with_link

    run(main(), timeout_s=180.0)


@contextlib.contextmanager
def frozen(process):
    """Freeze a process, with all its threads, while the block runs."""
    process.send_signal(signal.SIGSTOP)
    threads = Path(f"/proc/{process.pid}/task")
    try:
        while any(") T" not in each.read_text() for each in threads.glob("*/stat")):
            time.sleep(0.001)
        yield
    finally:
        process.send_signal(signal.SIGCONT)


# The lease of 5 s lives on, or ends meanwhile.
@pytest.mark.processes
@pytest.mark.parametrize("seconds", [2.0, 6.0])
def test_the_motions_of_a_gateway_that_was_frozen_end_when_it_goes_on(mesh, tmp_path, monkeypatch, seconds):
    async def main():
        async with contextlib.AsyncExitStack() as stack:
            arms = [await stack.enter_async_context(watched(mover, mesh, monkeypatch)) for mover in MOVERS]
            robots = [each.settings() for each in arms]
            async with gateway_process(mesh, tmp_path, robots) as process:
                await all_in_control(arms)
                async with kept_control(*(each.site for each in arms)):
                    await all_crawl(arms)
                for arm in arms:
                    await arm.site.lease(A.RENEW)
                sent = [each.motions for each in arms]
                with frozen(process):
                    late = [asyncio.create_task(refusal(each.move(-0.1))) for each in arms]
                    for arm in arms:
                        if arm.dies_with_link:
                            rest_s, late_s = await time_to_rest(arm)
                            print(f"{arm.name}: at rest {rest_s:.3f} s after the gateway was frozen")
                            assert rest_s < 0.2 + 2 * late_s
                    await asyncio.sleep(seconds)
                    assert all(each.moves() is not bool(each.dies_with_link) for each in arms)
                for arm in arms:
                    rest_s, _ = await time_to_rest(arm)
                    print(f"{arm.name}: at rest {rest_s:.3f} s after it went on")
                for arm, task, number in zip(arms, late, sent, strict=True):
                    assert "Not sent" in await task
                    if seconds > 5.0:
                        await until(lambda arm=arm: arm.site.seen["lease"][-1].holder == "")
                    await until(lambda arm=arm: arm.site.controller.HasField("stop"))
                    await rests_for_good(arm, motions=number)

    run(main(), timeout_s=180.0)


@pytest.mark.processes
async def test_a_command_that_waited_for_a_frozen_gateway_is_not_sent(mesh, tmp_path, monkeypatch):
    async with (
        watched(UnitMover, mesh, monkeypatch) as arm,
        gateway_process(mesh, tmp_path, [arm.settings()]) as process,
    ):
        await all_in_control([arm])
        with frozen(process):
            late = asyncio.create_task(refusal(arm.move(0.1)))
            await asyncio.sleep(1.5)
        assert "Not sent" in await late
        assert not arm.site.controller.HasField("stop")
        judge(arm, motions=0)
        target = await arm.moved(0.1)
        async with kept_control(arm.site):
            await until(lambda: near(arm.positions(), target))
