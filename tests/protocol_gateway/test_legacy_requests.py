"""Requests of old client programs' units, and the ERROR numbers of refusals."""

import asyncio
import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol_gateway.authority.events import LeaseEnded, MotionObserved
from protocol_gateway.authority.lease_rules import Authority, LatchedStop
from protocol_gateway.authority.preconditions import ControllerState
from protocol_gateway.legacy.requests import (
    asks_for_more,
    number_of,
    requests_of,
    stop_to_reset,
)
from protocol_gateway.legacy.settings import plain_address
from protocol_gateway.link.link import LinkState, LinkStatus
from protocol_gateway.seam import (
    COMMANDS,
    Activity,
    Capabilities,
    Mode,
    Recovery,
    StatusReceived,
)
from protocol_gateway.unit_protocol.records import Error, asks_to_stop, read_records, write_unit
from protocol_gateway.unit_protocol.stream import Unit, UnitStream
from robomesh import reason_codes as codes
from robomesh.schemas.robomesh_pb2 import CommandRequest, LeaseRequest, Recover
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of
from tests.protocol_gateway.control_bench import control_bench

JOINTS = joints_of(load("pt600"))
A = LeaseRequest.Action
C = CommandRequest.Command
READY = ControllerState(
    link=LinkStatus(LinkState.UP, codes.LINK_CONNECTED(where="there")),
    status=StatusReceived(Activity.IDLE, Mode.REMOTE, True, False),
    positions=(0.0,) * 5,
)


def requests(text):
    return requests_of(read_records(text.encode()), JOINTS)


async def refused(bench, unit, *, first_id=1, **fields):
    """Return the ERROR number of Control's refusal of a unit's requests."""
    asked = requests(unit)
    for number, request in enumerate(asked):
        request.MergeFrom(CommandRequest(lease=bench.secret, id=first_id + number, **fields))
    answer = await bench.control.attempt(asked, operator="li", source="test")
    assert not answer.accepted
    return number_of(answer)


def with_status(**changes):
    return replace(READY, status=replace(READY.status, **changes))


def test_the_papers_unit_is_three_requests_in_its_order():
    unit = "2# COMMAND* trace; home&ABSOLUTE.DEG* 100.00; 30.45; 92.66; - 67.10; - 25.85"
    trace, home, move = requests(unit)
    assert [each.command for each in (trace, home, move)] == [C.TRACE_ON, C.HOME, C.MOVE_ABSOLUTE]
    expected = [math.radians(value) for value in (100.00, 30.45, 92.66, -67.10, -25.85)]
    assert list(move.joint_positions) == pytest.approx(expected, abs=1e-12)


def test_every_word_but_stop_has_a_request():
    words = "1#COMMAND*trace;untrace;home;hold;resume;stop;reset;speed=25"
    assert [C.Name(each.command) for each in requests(words)] == [
        "TRACE_ON", "TRACE_OFF", "HOME", "HOLD", "RESUME", "RESET", "SPEED",
    ]  # fmt: skip
    assert requests(words)[-1].speed_percent == 25.0
    assert requests("1#RELATIVE.DEG*1;0;0;0;0")[0].command == C.MOVE_RELATIVE


@pytest.mark.parametrize(
    ("unit", "stops", "more"),
    [
        ("1#COMMAND*stop", True, False),
        ("2#COMMAND*stop&STATUS*idle", True, False),
        ("1#COMMAND*home;stop", True, True),
        ("2#TIME*1&VELOCITY.DEG*1;2", False, False),
        ("1#ERROR*9;broken", False, False),
        ("2#STATUS*idle&ABSOLUTE.DEG*1;2;3;4;5", False, True),
        ("1#THERMAL*1", False, True),
        ("1#STATUS*stop", False, False),
    ],
)
def test_requests_are_distinguished_from_states(unit, stops, more):
    records = read_records(unit.encode())
    assert (asks_to_stop(records), asks_for_more(records)) == (stops, more)


@pytest.mark.parametrize(
    ("unit", "number"),
    [
        ("1#COMMAND*home;sing", 3),
        ("1#COMMAND*speed=1e999", 2),
        ("2#COMMAND*home&THERMAL*1", 3),
        ("1#COMMAND*" + ";".join(["hold"] * 17), 2),
        ("1#ABSOLUTE.DEG*1;2;3;4", 4),
        ("1#RELATIVE.DEG*1;2;3;4;5;6", 4),
        ("3#ABSOLUTE.DEG*1;2;3;4;5&VELOCITY.DEG*0;0;0;0;0&STATUS*idle", 7),
        ("2#ABSOLUTE.DEG*1;2;3;4;5&TIME*7", 7),
    ],
)
def test_a_refused_unit_has_one_error_number(unit, number):
    refusal = requests(unit)
    assert isinstance(refusal, Error)
    assert refusal.number == number


@pytest.mark.parametrize(
    ("unit", "controller", "number"),
    [
        ("1#COMMAND*home", replace(READY, read_only=codes.STOP_NOT_PROVEN()), 7),
        ("1#COMMAND*home", replace(READY, link=LinkStatus(LinkState.DOWN, codes.LINK_CLOSED())), 9),
        ("1#COMMAND*home", replace(READY, link=LinkStatus(LinkState.SILENT, codes.LINK_CLOSED())), 9),
        ("1#COMMAND*home", with_status(mode=Mode.LOCAL), 6),
        ("1#COMMAND*home", with_status(mode=None), 6),
        ("1#COMMAND*home", with_status(activity=Activity.STOPPED), 8),
        ("1#ABSOLUTE.DEG*0;0;0;0;0", with_status(activity=Activity.HOLDING), 8),
        ("1#COMMAND*home", with_status(activity=Activity.FAULT), 9),
        ("1#ABSOLUTE.DEG*0;0;0;0;0", with_status(homed=False), 9),
        ("1#ABSOLUTE.DEG*999;0;0;0;0", with_status(homed=False), 9),
        ("1#ABSOLUTE.DEG*999;0;0;0;0", READY, 5),
        ("1#COMMAND*speed=0", READY, 5),
        # Evaluated after the previous ones.
        ("2#COMMAND*home&ABSOLUTE.DEG*999;0;0;0;0", with_status(homed=False), 5),
        ("2#COMMAND*reset&ABSOLUTE.DEG*999;0;0;0;0", with_status(activity=Activity.STOPPED), 5),
        ("1#COMMAND*hold;home", READY, 8),
    ],
)
async def test_a_refusal_has_the_number_of_its_reason(tmp_path, unit, controller, number):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        bench.known = controller
        assert await refused(bench, unit) == number
        assert bench.socket == []


async def test_without_control_the_refusal_is_read_only(tmp_path):
    async with control_bench(tmp_path) as bench:
        assert await refused(bench, "1#COMMAND*home") == 7
        await bench.lease(A.ACQUIRE)
        asked = asyncio.create_task(refused(bench, "1#COMMAND*home"))
        await asyncio.sleep(0)  # the audit entry is being written now
        bench.control.handle(LeaseEnded(codes.ENDED_GATEWAY()))
        assert await asked == 7


async def test_motion_under_a_latched_stop_and_a_reset_while_the_robot_moves_are_refused_as_stopped(tmp_path):
    async with control_bench(tmp_path) as bench:
        await bench.lease(A.ACQUIRE)
        bench.control.stop(by="wang", reason="smoke", source="test")
        assert await refused(bench, "1#COMMAND*home", first_id=1) == 8
        bench.control.handle(MotionObserved(True))
        assert await refused(bench, "1#COMMAND*reset", first_id=2, stop_id=1) == 8


def test_reset_means_a_stop_that_its_sender_can_have_seen():
    assert stop_to_reset(Authority(), 100.0) == 0
    stop = LatchedStop(id=3, by="wang", reason="smoke", since_ns=0, sent_s=10.0)
    assert stop_to_reset(Authority(stop=stop), 11.5) == 3
    fresh = stop_to_reset(Authority(stop=stop), 10.5)
    assert isinstance(fresh, Error)
    assert (fresh.number, "stop request 3 (wang, smoke) has just been sent" in fresh.text) == (8, True)
    unsent = stop_to_reset(Authority(stop=replace(stop, sent_s=None)), 100.0)
    assert isinstance(unsent, Error)


def test_an_address_is_normalized():
    assert plain_address("::ffff:10.0.0.9") == plain_address("10.0.0.9") == "10.0.0.9"
    assert plain_address("FE80:0:0::1") == "fe80::1"
    with pytest.raises(ValueError, match=r"ten\.0\.0\.9"):
        plain_address("ten.0.0.9")


WORDS = ("home", "stop", "hold", "reset", "speed=50", "speed=", "sing", "", "1e999", "- 7")
TYPES = ("COMMAND", "ABSOLUTE.DEG", "RELATIVE.DEG", "STATUS", "TIME", "ERROR", "2", "99", "X")
RECORDS = st.lists(
    st.tuples(st.sampled_from(TYPES), st.lists(st.sampled_from(WORDS) | st.floats().map(str), max_size=6)),
    min_size=1,
    max_size=4,
)


@given(RECORDS)
def test_any_unit_is_requests_or_a_refusal(records):
    text = "&".join(f"{kind}*{';'.join(items)}" for kind, items in records)
    for event in UnitStream().receive(f"{len(records)}#{text}@".encode()):
        if not isinstance(event, Unit):
            continue
        asked = requests_of(event.records, JOINTS)
        if isinstance(asked, Error):
            assert write_unit((asked,))
        else:
            assert not asked or asks_for_more(event.records)


@pytest.mark.parametrize("word", ["recover", "unlock_protective_stop", "power_on", "servo_on"])
def test_recoveries_are_refused_in_words(word):
    answer = requests(f"1#COMMAND*{word}")
    assert isinstance(answer, Error)
    assert "may not recover a controller" in answer.text


async def test_a_recovery_of_another_source_than_the_mesh_or_beside_others_is_refused(tmp_path):
    capabilities = Capabilities(commands=COMMANDS, recoveries=frozenset(Recovery))
    recover = Recover(recovery=Recover.POWER_ON, reason="fuse", looked=True)
    mine = {"command": C.RECOVER, "recover": recover}
    async with control_bench(tmp_path) as bench:
        bench.known = replace(READY, capabilities=capabilities, recover=frozenset(Recovery))
        await bench.lease(A.ACQUIRE)
        bench.control.handle(MotionObserved(moving=False))
        for source, alone in (("tcp 10.0.0.9", True), ("program", True), ("mesh", False)):
            request = CommandRequest(lease=bench.secret, id=1, **mine)
            others = [] if alone else [CommandRequest(lease=bench.secret, id=2, command=C.HOLD)]
            answer = await bench.control.attempt([request, *others], operator="li", source=source)
            assert answer.reason.code == codes.RECOVER_PROGRAM.name, source
            await bench.lease(A.RELEASE, lease=bench.secret)
            await bench.lease(A.ACQUIRE)
        step = await bench.control.step(CommandRequest(lease=bench.secret, **mine), operator="li")
        assert step.reason.code == codes.RECOVER_PROGRAM.name
        assert bench.socket == []
