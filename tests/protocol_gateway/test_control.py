"""Control of one robot: units of several commands, leases, what happens while the disk is waited for."""

import asyncio
from math import radians

import pytest

from protocol_gateway.authority.lease_rules import Authority
from protocol_gateway.drivers.driver import Activity, Mode, StatusReceived
from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from tests.conftest import run
from tests.protocol_gateway.hall import until
from tests.protocol_gateway.place import place

C = schema.CommandRequest.Command
A = schema.LeaseRequest.Action

POSITIONS = (100.0, 30.45, 92.66, -67.1, -25.85)


def move(*degrees):
    return C.MOVE_ABSOLUTE, {"joint_positions": [radians(value) for value in degrees]}


def test_commands_of_one_unit_are_judged_as_those_before_them_leave_the_robot(tmp_path):
    async def main():
        async with place(tmp_path) as it:
            await it.lease(A.ACQUIRE)
            # Not homed yet: the move is allowed because of the homing before it.
            answer = await it.commands((C.TRACE_ON, {}), (C.HOME, {}), move(*POSITIONS))
            assert it.socket == [
                b"3#COMMAND*trace&COMMAND*home&ABSOLUTE.DEG*100.00;30.45;92.66;-67.10;-25.85@"
            ]
            assert answer.text == "TRACE_ON, HOME, MOVE_ABSOLUTE are on the controller's socket"
            assert [name for name, _ in it.entries()] == ["ACQUIRE", "TRACE_ON", "HOME", "MOVE_ABSOLUTE"]
            with pytest.raises(RefusedError, match="not homed"):
                await it.commands(move(*POSITIONS), first_id=4)

    run(main())


@pytest.mark.parametrize(
    ("commands", "words"),
    [
        ([(C.HOME, {}), move(200, 0, 0, 0, 0)], "waist at 200.00° is beyond its limit 150.00°"),
        ([(C.HOME, {}), (C.HOLD, {}), move(0, 0, 0, 0, 0)], "on hold"),
        ([(C.HOME, {}), move(0, 0, 0)], "3 joint positions, but the robot has 5"),
        ([(C.HOME, {}), (C.RESET, {"stop_id": 7})], "stop 7 is not latched"),
        # 140 degrees from home, and 20 more.
        (
            [(C.HOME, {}), move(140, 0, 0, 0, 0), (C.MOVE_RELATIVE, {"joint_positions": [0.35, 0, 0, 0, 0]})],
            "waist at 160.05° is beyond",
        ),
    ],
)
def test_commands_of_one_unit_are_done_all_or_none(tmp_path, commands, words):
    async def main():
        async with place(tmp_path) as it:
            await it.lease(A.ACQUIRE)
            with pytest.raises(RefusedError, match=words):
                await it.commands(*commands)
            assert it.socket == []
            # Its ids are used up.
            with pytest.raises(RefusedError, match="id 1 is not higher"):
                await it.commands((C.HOME, {}))
        asked = [outcome.value for name, outcome in it.entries() if name not in ("ACQUIRE", "REVOKE")]
        assert asked == ["REFUSED"] * (len(commands) + 1)

    run(main())


def test_a_reset_in_a_unit_allows_the_motion_behind_it(tmp_path):
    async def main():
        async with place(tmp_path) as it:
            await it.lease(A.ACQUIRE)
            it.status = StatusReceived(activity=Activity.STOPPED, mode=Mode.REMOTE, homed=True)
            it.control.stop(by="wang", reason="fire", source="test")
            with pytest.raises(RefusedError, match="stop 1 is latched"):
                await it.commands(move(*POSITIONS))
            await it.commands((C.RESET, {"stop_id": 1}), move(*POSITIONS), first_id=2)
            assert it.socket[0] == b"1#COMMAND*stop@"
            assert it.socket[1].startswith(b"2#COMMAND*reset&ABSOLUTE.DEG*")
            assert it.control.authority.stop is None
            assert it.control.authority.lease.motion is not None

    run(main())


def test_a_stop_while_a_unit_is_being_written_down_forbids_all_of_it(tmp_path):
    async def main():
        async with place(tmp_path) as it:
            await it.lease(A.ACQUIRE)
            commands = asyncio.create_task(it.commands((C.TRACE_ON, {}), (C.HOME, {})))
            await asyncio.sleep(0)  # it waits for the disk now
            it.control.stop(by="wang", reason="fire", source="test")
            with pytest.raises(RefusedError, match="stop 1 is latched"):
                await commands
            assert it.socket == [b"1#COMMAND*stop@"]
        failed = [name for name, outcome in it.entries() if outcome.value == "FAILED"]
        assert failed == ["TRACE_ON", "HOME"]

    run(main())


def test_a_motion_that_hold_has_overtaken_is_not_sent(tmp_path):
    async def main():
        async with place(tmp_path) as it:
            await it.lease(A.ACQUIRE)
            motion = asyncio.create_task(it.commands((C.HOME, {})))
            await asyncio.sleep(0)  # it waits for the disk now
            hold = asyncio.create_task(it.commands((C.HOLD, {}), first_id=2))
            with pytest.raises(RefusedError, match="HOLD came before it could be sent"):
                await motion
            await hold
            assert it.socket == [b"1#COMMAND*hold@"]
            assert it.control.authority.lease.motion is None

    run(main())


def test_a_session_that_is_gone_takes_its_own_lease_with_it_and_stops_its_motion(tmp_path):
    async def main():
        async with place(tmp_path) as it:
            await it.lease(A.ACQUIRE, session="s1")
            it.control.leases.end_session("s2")
            it.control.leases.end_session("")
            assert it.control.authority.lease is not None
            await it.commands((C.HOME, {}))
            it.control.leases.end_session("s1")
            assert it.control.authority.lease is None
            assert it.control.authority.ended.code == "lease.ended.session"
            assert it.socket[-1] == b"1#COMMAND*stop@"
            assert it.control.authority.stop.reason == "dead-man: li's page or program has gone"

    run(main())


def test_a_link_that_is_lost_while_the_holders_motion_runs_is_a_stop_that_waits_for_it(tmp_path):
    async def main():
        async with place(tmp_path) as it:
            await it.lease(A.ACQUIRE)
            it.control.link_lost("the cable is cut")
            assert it.control.authority.stop is None
            await it.commands((C.HOME, {}))
            it.broken = True
            it.control.link_lost("the cable is cut")
            assert it.control.authority.stop.sent_s is None
            assert it.control.authority.lease is not None
            assert len(it.socket) == 1
            it.broken = False
            it.control.send_latched_stop()
            assert it.socket[1:] == [b"1#COMMAND*stop@"]

    run(main())


def test_who_asks_for_control_is_shown_to_its_holder_until_he_gets_it(tmp_path):
    async def main():
        async with place(tmp_path) as it:
            with pytest.raises(RefusedError, match="nobody is in control: take it"):
                await it.lease(A.ASK, "wang")
            await it.lease(A.ACQUIRE)
            with pytest.raises(RefusedError, match="li is in control already"):
                await it.lease(A.ASK)
            for reason in ("lunch", "lunch is over"):
                await it.lease(A.ASK, "wang", reason=reason)
            await it.lease(A.ASK, "zhao")
            asked_by = it.control.authority.asked_by
            assert [(each.operator, each.reason) for each in asked_by] == [
                ("wang", "lunch is over"),
                ("zhao", ""),
            ]
            await it.lease(A.OFFER, lease=it.secret, to="wang")
            await it.lease(A.ACCEPT, "wang")
            assert it.control.authority.ended.code == "lease.ended.handed_over"
            assert [each.operator for each in it.control.authority.asked_by] == ["zhao"]
        # Asking again within half a minute is no new entry.
        assert [name for name, outcome in it.entries() if outcome.value == "ACCEPTED"].count("ASK") == 2

    run(main())


def test_a_lease_that_ends_while_its_command_is_being_written_down_takes_the_command_with_it(tmp_path):
    async def main():
        async with place(tmp_path) as it:
            await it.lease(A.ACQUIRE)
            command = asyncio.create_task(it.commands((C.HOME, {})))
            await asyncio.sleep(0)  # it waits for the disk now
            it.control.leases.end(codes.ENDED_GATEWAY())
            with pytest.raises(RefusedError, match="control ended while"):
                await command
            assert it.socket == []

    run(main())


def test_a_stop_that_is_told_long_after_the_reset_is_a_new_one(tmp_path, clock):
    async def main():
        async with place(tmp_path) as it:
            await it.lease(A.ACQUIRE)
            it.status = StatusReceived(activity=Activity.STOPPED, mode=Mode.REMOTE, homed=True)
            await it.commands((C.RESET, {}))
            clock.goes_on(0.31)
            with pytest.raises(RefusedError, match="the controller is stopped"):
                await it.commands(move(*POSITIONS), first_id=2)

    run(main())


@pytest.mark.parametrize(
    ("before", "wait_s", "behind", "over"),
    [
        ((), 0.0, (), True),
        ((C.SPEED, {"speed_percent": 50}), 0.0, (), False),
        ((C.SPEED, {"speed_percent": 50}), 1.9, (), False),
        ((C.SPEED, {"speed_percent": 50}), 2.1, (), True),
        ((), 0.0, (C.SPEED, {"speed_percent": 50}), False),
    ],
)
def test_a_refusal_ends_a_motion_only_where_it_can_be_an_answer_to_nothing_else(
    tmp_path, clock, before, wait_s, behind, over
):
    async def main():
        async with place(tmp_path) as it:
            await it.lease(A.ACQUIRE, ttl_s=5)
            if before:
                await it.commands(before, first_id=1)
            clock.goes_on(wait_s)
            await it.commands((C.HOME, {}), first_id=2)
            if behind:
                await it.commands(behind, first_id=3)
            it.control.refused()
            assert (it.control.authority.lease.motion is None) == over

    run(main())


def test_a_refusal_of_a_unit_is_of_all_its_commands(tmp_path):
    async def main():
        async with place(tmp_path) as it:
            await it.lease(A.ACQUIRE)
            await it.commands((C.SPEED, {"speed_percent": 50}), (C.HOME, {}))
            it.control.refused()
            assert it.control.authority.lease.motion is None

    run(main())


def test_what_a_killed_gateways_holder_set_in_motion_is_stopped_by_the_next_one(tmp_path):
    async def main():
        async with place(tmp_path) as it:
            await it.lease(A.ACQUIRE)
            await it.commands((C.HOME, {}))
            it.control._context.authority = Authority()
            it.control._context.orphan = it.log.state.mover
            it.control.observe(moving=True)
            assert it.control.authority.stop.reason == (
                "dead-man: the gateway was killed while li had control, and the robot still moves"
            )
            assert it.socket[-1] == b"1#COMMAND*stop@"

    run(main())


def test_a_robot_that_stands_when_the_gateway_is_back_is_not_stopped(tmp_path):
    async def main():
        async with place(tmp_path) as it:
            it.control._context.orphan = "li"
            it.control.observe(moving=False)
            it.control.observe(moving=True)
            assert it.control.authority.stop is None
            await it.lease(A.ACQUIRE)
            await it.commands((C.HOME, {}))
            await it.lease(A.RELEASE, lease=it.secret)
            await until(lambda: it.log.state.mover == "")

    run(main())
