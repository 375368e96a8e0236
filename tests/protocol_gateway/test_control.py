"""Control of one robot: units of several commands, leases, and events during a write to disk."""

import asyncio
import math
from math import radians

import pytest

from protocol_gateway.audit.files import read_entries
from protocol_gateway.authority.events import (
    LeaseEnded,
    LinkLost,
    LinkRestored,
    MotionObserved,
    SessionEnded,
    UnitRefused,
)
from protocol_gateway.seam import Activity, Mode, StatusReceived
from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from tests.protocol_gateway.control_bench import control_bench
from tests.protocol_gateway.gateway_site import until
from tests.refusals import refused

C = schema.CommandRequest.Command
A = schema.LeaseRequest.Action

POSITIONS = (100.0, 30.45, 92.66, -67.1, -25.85)


def move(*degrees):
    return C.MOVE_ABSOLUTE, {"joint_positions": [radians(value) for value in degrees]}


async def test_commands_of_one_unit_are_evaluated_after_the_previous_ones(tmp_path):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        # Not homed yet: the move is allowed because of the homing before bench.
        answer = await bench.commands((C.TRACE_ON, {}), (C.HOME, {}), move(*POSITIONS))
        assert bench.socket == [
            b"3#COMMAND*trace&COMMAND*home&ABSOLUTE.DEG*100.00;30.45;92.66;-67.10;-25.85@"
        ]
        assert answer.text == "TRACE_ON, HOME, MOVE_ABSOLUTE are on the controller's socket"
        assert [name for name, _ in bench.entries()] == ["ACQUIRE", "TRACE_ON", "HOME", "MOVE_ABSOLUTE"]
        with refused(codes.ROBOT_NOT_HOMED):
            await bench.commands(move(*POSITIONS), first_id=4)


async def test_what_the_page_showed_is_in_the_audit_log_but_no_part_of_the_command(tmp_path):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        page = schema.PageReport(view="front", picture=7, picture_age_s=0.25, state_age_s=math.nan)
        page.picture_time.FromNanoseconds(1_700_000_000_123_456_000)
        await bench.commands((C.TRACE_ON, {"page": page}))
        # The same command, sent again by a page that shows a later picture.
        page.picture += 1
        await bench.commands((C.TRACE_ON, {"page": page}))
        page.picture_time.seconds = 1 << 60
        bench.control.stop(by="wang", reason="", source="mesh", page=page)
        await until(lambda: len(bench.entries()) == 3)
        first = {
            "id": "1",
            "page_view": "front",
            "page_picture": "7",
            "page_picture_time": "2023-11-14T22:13:20.123456Z",
            "page_picture_age_s": "0.250",
        }
        values = [entry.values for entry in read_entries(tmp_path / "arm.jsonl")]
        assert values[1] == first
        assert values[2]["page_picture"] == "8"
        assert "page_picture_time" not in values[2]


@pytest.mark.parametrize(
    ("commands", "code", "values"),
    [
        ([(C.HOME, {}), move(200, 0, 0, 0, 0)], codes.JOINT_LIMIT, {"name": "waist", "value": "200.00°"}),
        ([(C.HOME, {}), (C.HOLD, {}), move(0, 0, 0, 0, 0)], codes.CONTROLLER_HOLDING, {}),
        ([(C.HOME, {}), move(0, 0, 0)], codes.JOINT_COUNT, {"count": "3"}),
        ([(C.HOME, {}), (C.RESET, {"stop_id": 7})], codes.STOP_NOT_LATCHED, {"id": "7"}),
        # 140 degrees from home, and 20 more.
        (
            [(C.HOME, {}), move(140, 0, 0, 0, 0), (C.MOVE_RELATIVE, {"joint_positions": [0.35, 0, 0, 0, 0]})],
            codes.JOINT_LIMIT,
            {"name": "waist", "value": "160.05°"},
        ),
    ],
)
async def test_commands_of_one_unit_are_all_or_none(tmp_path, commands, code, values):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        with refused(code, **values):
            await bench.commands(*commands)
        assert bench.socket == []
        # Its ids are used.
        with refused(codes.COMMAND_ID_OLD, id="1"):
            await bench.commands((C.HOME, {}))
    asked = [outcome.value for name, outcome in bench.entries() if name not in ("ACQUIRE", "REVOKE")]
    assert asked == ["REFUSED"] * (len(commands) + 1)


async def test_a_reset_in_a_unit_allows_the_motion_behind_it(tmp_path):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        bench.status = StatusReceived(activity=Activity.STOPPED, mode=Mode.REMOTE, homed=True)
        bench.control.stop(by="wang", reason="fire", source="test")
        with refused(codes.STOP_LATCHED, id="1"):
            await bench.commands(move(*POSITIONS))
        await bench.commands((C.RESET, {"stop_id": 1}), move(*POSITIONS), first_id=2)
        assert bench.socket[0] == b"1#COMMAND*stop@"
        assert bench.socket[1].startswith(b"2#COMMAND*reset&ABSOLUTE.DEG*")
        assert bench.control.authority.stop is None
        assert bench.control.authority.lease.motion is not None


async def test_a_stop_during_the_audit_write_forbids_the_unit(tmp_path):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        commands = asyncio.create_task(bench.commands((C.TRACE_ON, {}), (C.HOME, {})))
        await asyncio.sleep(0)  # the command waits for the disk now
        bench.control.stop(by="wang", reason="fire", source="test")
        with refused(codes.STOP_LATCHED, id="1"):
            await commands
        assert bench.socket == [b"1#COMMAND*stop@"]
    failed = [name for name, outcome in bench.entries() if outcome.value == "FAILED"]
    assert failed == ["TRACE_ON", "HOME"]


async def test_a_motion_overtaken_by_hold_is_not_sent(tmp_path):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        motion = asyncio.create_task(bench.commands((C.HOME, {})))
        await asyncio.sleep(0)  # the command waits for the disk now
        hold = asyncio.create_task(bench.commands((C.HOLD, {}), first_id=2))
        with refused(codes.COMMAND_HELD):
            await motion
        await hold
        assert bench.socket == [b"1#COMMAND*hold@"]
        assert bench.control.authority.lease.motion is None


async def test_an_ended_session_ends_its_lease_and_stops_its_motion(tmp_path):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE, session="s1")
        bench.control.handle(SessionEnded("s2"))
        bench.control.handle(SessionEnded(""))
        assert bench.control.authority.lease is not None
        await bench.commands((C.HOME, {}))
        bench.control.handle(SessionEnded("s1"))
        assert bench.control.authority.lease is None
        assert bench.control.authority.ended.code == "lease.ended.session"
        assert bench.socket[-1] == b"1#COMMAND*stop@"
        assert bench.control.authority.stop.reason == "dead-man: li's page or program has disconnected"
        why = bench.control.authority.stop.why
        assert (why.code, why.causes[0].code) == ("stop.control_ended", "lease.ended.session")


async def test_a_lost_link_during_motion_is_a_stop(tmp_path):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        bench.control.handle(LinkLost("the cable is cut"))
        assert bench.control.authority.stop is None
        await bench.commands((C.HOME, {}))
        bench.broken = True
        bench.control.handle(LinkLost("the cable is cut"))
        assert bench.control.authority.stop.sent_s is None
        assert bench.control.authority.lease is not None
        assert len(bench.socket) == 1
        bench.broken = False
        bench.control.handle(LinkRestored())
        assert bench.socket[1:] == [b"1#COMMAND*stop@"]


async def test_a_request_for_control_is_shown_until_it_is_granted(tmp_path):
    async with control_bench(tmp_path) as bench:
        with refused(codes.LEASE_FREE):
            await bench.lease(A.ASK, "wang")
        await bench.lease(A.ACQUIRE)
        with refused(codes.LEASE_OWN):
            await bench.lease(A.ASK)
        for reason in ("lunch", "lunch is over"):
            await bench.lease(A.ASK, "wang", reason=reason)
        await bench.lease(A.ASK, "zhao")
        asked_by = bench.control.authority.asked_by
        assert [(each.operator, each.reason) for each in asked_by] == [
            ("wang", "lunch is over"),
            ("zhao", ""),
        ]
        await bench.lease(A.OFFER, lease=bench.secret, to="wang")
        await bench.lease(A.ACCEPT, "wang")
        assert bench.control.authority.ended.code == "lease.ended.handed_over"
        assert [each.operator for each in bench.control.authority.asked_by] == ["zhao"]
    # A repeated ASK within half a minute has no entry.
    assert [name for name, outcome in bench.entries() if outcome.value == "ACCEPTED"].count("ASK") == 2


async def test_a_lease_that_ends_during_the_audit_write_cancels_the_command(tmp_path):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        command = asyncio.create_task(bench.commands((C.HOME, {})))
        await asyncio.sleep(0)  # the command waits for the disk now
        bench.control.handle(LeaseEnded(codes.ENDED_GATEWAY()))
        with pytest.raises(RefusedError) as refused:
            await command
        assert refused.value.reason.code == "command.control_ended_meanwhile"
        assert bench.socket == []


async def test_a_stop_reported_long_after_a_reset_is_new(tmp_path, clock):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        bench.status = StatusReceived(activity=Activity.STOPPED, mode=Mode.REMOTE, homed=True)
        await bench.commands((C.RESET, {}))
        clock.advance(0.31)
        with refused(codes.CONTROLLER_STOPPED):
            await bench.commands(move(*POSITIONS), first_id=2)


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
async def test_a_refusal_ends_a_motion_only_if_it_cannot_answer_another_unit(
    tmp_path, clock, before, wait_s, behind, over
):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE, ttl_s=5)
        if before:
            await bench.commands(before, first_id=1)
        clock.advance(wait_s)
        await bench.commands((C.HOME, {}), first_id=2)
        if behind:
            await bench.commands(behind, first_id=3)
        bench.control.handle(UnitRefused())
        assert (bench.control.authority.lease.motion is None) == over


async def test_a_refusal_of_a_unit_is_of_all_its_commands(tmp_path):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        await bench.commands((C.SPEED, {"speed_percent": 50}), (C.HOME, {}))
        bench.control.handle(UnitRefused())
        assert bench.control.authority.lease.motion is None


async def test_motion_from_before_a_kill_is_stopped(tmp_path):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        await bench.commands((C.HOME, {}))
        bench.restart(orphan=bench.log.state.mover)
        bench.control.handle(MotionObserved(True))
        assert bench.control.authority.stop.reason == (
            "dead-man: the gateway was killed while li had control, and the robot still moves"
        )
        assert bench.socket[-1] == b"1#COMMAND*stop@"


async def test_a_robot_at_rest_after_a_kill_is_not_stopped(tmp_path):
    async with control_bench(tmp_path) as bench:
        bench.restart(orphan="li")
        bench.control.handle(MotionObserved(False))
        bench.control.handle(MotionObserved(True))
        assert bench.control.authority.stop is None
        await bench.lease(A.ACQUIRE)
        await bench.commands((C.HOME, {}))
        await bench.lease(A.RELEASE, lease=bench.secret)
        await until(lambda: bench.log.state.mover == "")
