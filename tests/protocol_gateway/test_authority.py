"""Rules of authority, with clocks set by the tests."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol_gateway.authority.admission import admit, keep_answer, wait_refusal
from protocol_gateway.authority.lease_rules import (
    Answer,
    Authority,
    Now,
    end_lease,
    expire,
    holds,
    request_lease,
)
from protocol_gateway.authority.motion_owner import drop_refused, follow_motion, record_command
from protocol_gateway.authority.stop_rules import latch_stop, mark_sent
from robomesh import reason_codes as codes
from robomesh.schemas.robomesh_pb2 import CommandRequest, LeaseRequest

A = LeaseRequest.Action
C = CommandRequest.Command


def at(seconds):
    return Now(1000.0 + seconds, round((5000.0 + seconds) * 1e9), round((7000.0 + seconds) * 1e9))


def ask(authority, action, operator="li", *, time_s=0.0, secret="fresh", **fields):
    request = LeaseRequest(action=action, **fields)
    return request_lease(authority, request, operator=operator, now=at(time_s), secret=secret)


def held(**fields):
    return ask(Authority(), A.ACQUIRE, secret="s", **fields).authority


def command(kind, number=1, **fields):
    return CommandRequest(**{"lease": "s", "id": number, "command": kind, **fields})


def moving(time_s=0.0):
    return record_command(held(), command(C.MOVE_ABSOLUTE), at(time_s))


def see(authority, moves, time_s, *, pending=False, arrived=False):
    return follow_motion(authority, moving=moves, pending=pending, arrived=arrived, now=at(time_s))


@pytest.mark.parametrize(("asked", "kept"), [(0, 2.0), (0.1, 0.5), (3, 3.0), (60, 5.0), (-1, 0.5)])
def test_a_leases_time_is_kept_between_half_a_second_and_five(asked, kept):
    assert held(ttl_s=asked).lease.ttl_s == kept


def test_a_lease_expires_at_its_time():
    authority = ask(held(), A.RENEW, time_s=1.5, lease="s").authority
    assert expire(authority, at(3.4)) == (authority, None)
    free, ended = expire(authority, at(3.5))
    assert free.lease is None
    assert (ended.holder, ended.renewals, ended.stop) == ("li", 1, False)


def test_the_holders_own_acquire_renews_and_keeps_the_secret():
    outcome = ask(held(), A.ACQUIRE, time_s=1.0, lease="s", secret="other")
    assert outcome.granted.secret == "s"
    assert outcome.granted.until_s == at(3.0).monotonic_s


@pytest.mark.parametrize(
    ("action", "operator", "fields", "words"),
    [
        (A.ACQUIRE, "wang", {}, "li is in control"),
        (A.ACQUIRE, "li", {}, "another window or program"),
        (A.RENEW, "li", {"lease": "t"}, "another window or program"),
        (A.RENEW, "wang", {"lease": "s"}, "li is in control"),
        (A.RELEASE, "wang", {"lease": "s"}, "li is in control"),
        (A.OFFER, "wang", {"lease": "s", "to": "zhao"}, "li is in control"),
        (A.ACCEPT, "wang", {}, "not offered to wang"),
        (A.TAKE, "wang", {"reason": "  "}, "needs a reason"),
    ],
)
def test_without_the_lease_requests_are_refused_with_the_reason(action, operator, fields, words):
    outcome = ask(held(), action, operator, **fields)
    assert not outcome.answer.accepted
    assert words in outcome.answer.text
    assert outcome.authority == held()
    assert outcome.granted is None


@pytest.mark.parametrize("action", [A.RENEW, A.RELEASE, A.OFFER])
def test_an_ended_lease_has_no_holder(action):
    free, _ = end_lease(held(), codes.ENDED_GATEWAY())
    outcome = ask(free, action, lease="s")
    assert "take control first" in outcome.answer.text


def test_an_offer_passes_the_lease_on_but_not_while_its_holders_motion_runs():
    offered = ask(moving(), A.OFFER, lease="s", to="wang").authority
    assert "motion is still running" in ask(offered, A.ACCEPT, "wang").answer.text
    offered = ask(held(), A.OFFER, lease="s", to="wang").authority
    passed = ask(offered, A.ACCEPT, "wang", secret="w")
    assert (passed.granted.holder, passed.ended.stop) == ("wang", False)
    assert not holds(passed.authority, "li", "s")


@pytest.mark.parametrize(
    "end",
    [
        lambda state: expire(state, at(2.0))[1],
        lambda state: ask(state, A.RELEASE, lease="s").ended,
        lambda state: ask(state, A.TAKE, "wang", reason="he left").ended,
        lambda state: end_lease(state, codes.ENDED_SESSION(name="li"))[1],
    ],
)
def test_every_end_of_a_lease_stops_its_holders_motion(end):
    assert end(moving()).stop
    assert end(record_command(moving(), command(C.HOLD), at(0.1))).stop
    assert not end(held()).stop


@pytest.mark.parametrize(
    ("cause", "why"),
    [
        (LeaseRequest.HIDDEN, codes.ENDED_HIDDEN),
        (LeaseRequest.NO_RIGHT, codes.ENDED_NO_RIGHT),
        (LeaseRequest.SIGNED_OUT, codes.ENDED_SIGNED_OUT),
    ],
)
def test_a_released_lease_has_its_clients_cause(cause, why):
    assert ask(held(), A.RELEASE, lease="s", cause=cause).ended.why == why(name="li")


def test_motion_is_over_when_the_robot_has_been_still_for_half_a_second():
    state, uncommanded = see(moving(), True, 0.1)
    assert not uncommanded
    state, _ = see(state, False, 0.5)
    assert state.lease.motion is not None
    state, _ = see(state, False, 0.6)
    assert state.lease.motion is None
    assert state.lease.commanded


@pytest.mark.parametrize(("arrived", "patience_s"), [(True, 2.0), (False, 30.0)])
def test_motion_that_has_not_begun_is_the_holders_until_a_timeout(arrived, patience_s):
    state, _ = see(moving(), False, patience_s - 0.1, arrived=arrived)
    assert state.lease.motion is not None
    state, _ = see(state, False, patience_s, arrived=arrived)
    assert state.lease.motion is None


def test_late_motion_is_the_holders_and_is_stopped_with_the_lease():
    state, _ = see(moving(), False, 2.5)
    state, uncommanded = see(state, True, 2.6)
    assert not uncommanded
    assert expire(state, at(2.7))[1].stop


def test_very_late_motion_is_stopped_because_it_may_be_the_holders():
    state, _ = see(moving(), False, 31.0)
    state, uncommanded = see(state, True, 32.0)
    assert uncommanded
    assert end_lease(state, codes.ENDED_FOREIGN_MOTION(), uncommanded=True)[1].stop
    assert not end_lease(held(), codes.ENDED_FOREIGN_MOTION(), uncommanded=True)[1].stop


def test_a_refused_motion_does_not_begin():
    assert drop_refused(moving()).lease.motion is None


def test_a_refusal_of_something_else_does_not_end_the_holders_motion():
    seen, _ = see(moving(), True, 0.1)
    later = record_command(moving(), command(C.SPEED), at(0.1))
    while_it_moves, _ = see(held(), True, 0.0)
    while_it_moves = record_command(while_it_moves, command(C.MOVE_ABSOLUTE), at(0.1))
    for state in (seen, later, while_it_moves):
        assert drop_refused(state) == state


def test_a_resumed_motion_keeps_its_target():
    state = record_command(held(), command(C.MOVE_ABSOLUTE), at(0), waypoints=((1.0,),))
    state = record_command(state, command(C.HOLD), at(1))
    assert record_command(state, command(C.RESUME), at(2)).lease.motion.target == (1.0,)


def test_a_held_motion_stays_the_holders_until_the_controller_reports_none():
    state = record_command(moving(), command(C.HOLD), at(0.1))
    state, _ = see(state, False, 100.0, pending=True)
    assert state.lease.motion is not None
    state, _ = see(state, False, 100.0, pending=False)
    assert state.lease.motion is None


def test_uncommanded_motion_is_detected_when_it_begins():
    state, uncommanded = see(held(), False, 0.0)
    assert not uncommanded
    state, uncommanded = see(state, True, 1.0)
    assert uncommanded
    state, uncommanded = see(state, True, 1.05)
    assert not uncommanded
    assert not state.lease.tolerates_motion


def test_motion_before_the_lease_is_tolerated_until_the_first_command():
    state, _ = see(Authority(), True, 0.0)
    state, _ = see(state, False, 0.1)
    state = ask(state, A.ACQUIRE, secret="s", time_s=5.0).authority
    assert state.lease.tolerates_motion
    assert record_command(state, command(C.TRACE_ON), at(6.0)).lease.tolerates_motion
    assert not record_command(state, command(C.HOME), at(6.0)).lease.tolerates_motion
    late = ask(replace(state, lease=None), A.ACQUIRE, time_s=50.0).authority
    assert not late.lease.tolerates_motion


def test_slowing_down_from_a_stop_is_not_uncommanded_motion():
    state, _ = see(moving(), True, 0.1)
    state, _ = latch_stop(state, by="wang", reason="", now=at(0.2))
    state, uncommanded = see(state, True, 0.25)
    assert not uncommanded
    assert state.uncommanded_s is None


def test_motion_seen_just_after_its_stop_is_not_uncommanded():
    state, latched = latch_stop(moving(), by="li", reason="", now=at(0.1))
    state, uncommanded = see(mark_sent(state, latched.id, 1000.1), True, 0.2)
    assert not uncommanded
    state, _ = see(state, False, 0.5)
    _, uncommanded = see(state, True, 2.2)
    assert uncommanded


def test_every_stop_has_a_number_and_only_its_own_reset_clears_it():
    state, first = latch_stop(held(), by="wang", reason="", now=at(0))
    state, second = latch_stop(state, by="zhao", reason="smoke", now=at(1))
    assert (first.id, second.id) == (1, 2)
    for stop_id, words in [
        (1, "RESET names stop 1, but stop 2 is latched (zhao: smoke)"),
        (0, "names stop 0"),
    ]:
        admission = admit(state, command(C.RESET, stop_id=stop_id), operator="li", now=at(2))
        assert words in admission.answer.text
    reset = command(C.RESET, stop_id=2)
    assert admit(state, reset, operator="li", now=at(2)).answer.accepted
    assert record_command(state, reset, at(2)).stop is None
    assert mark_sent(state, 1, 1003.0) == state
    assert "no stop is" in admit(held(), reset, operator="li", now=at(2)).answer.text


@pytest.mark.parametrize("kind", [C.HOME, C.RESUME, C.MOVE_ABSOLUTE, C.MOVE_RELATIVE, C.RUN_PROGRAM])
def test_a_latched_stop_forbids_motion(kind):
    state, _ = latch_stop(held(), by="wang", reason="", now=at(0))
    assert "stop 1 is latched" in admit(state, command(kind), operator="li", now=at(0)).answer.text


@pytest.mark.parametrize("kind", [C.HOLD, C.TRACE_ON, C.TRACE_OFF, C.SPEED])
def test_a_latched_stop_allows_commands_without_motion(kind):
    state, _ = latch_stop(held(), by="wang", reason="", now=at(0))
    assert admit(state, command(kind), operator="li", now=at(0)).answer.accepted


def test_an_id_is_used_once():
    state = keep_answer(held(), command(C.HOME, 5), Answer(True, "done"))
    again = admit(state, command(C.HOME, 5), operator="li", now=at(0))
    assert (again.answer, again.repeat) == (Answer(True, "done"), True)
    lower = admit(state, command(C.HOME, 4), operator="li", now=at(0))
    assert "id 4 is not higher than 5" in lower.answer.text
    assert not lower.id_used
    assert "id 0" in admit(held(), command(C.HOME, 0), operator="li", now=at(0)).answer.text
    assert admit(state, command(C.HOME, 6), operator="li", now=at(0)).answer.accepted


MOVE = {"joint_positions": [0.1, 0.0], "program_name": ""}


@pytest.mark.parametrize(
    ("kind", "fields", "words"),
    [
        (C.HOME, {}, "id 5 was used for MOVE_ABSOLUTE 0.1 0:"),
        (C.MOVE_RELATIVE, MOVE, "id 5 was used for MOVE_ABSOLUTE 0.1 0:"),
        (C.MOVE_ABSOLUTE, {"joint_positions": [0.1, 1e-12]}, "id 5 was used for MOVE_ABSOLUTE 0.1 0:"),
        (C.MOVE_ABSOLUTE, {**MOVE, "speed_percent": 0.0}, "id 5 was used for MOVE_ABSOLUTE 0.1 0:"),
        (C.MOVE_ABSOLUTE, {"joint_positions": [0.1, -0.0]}, ""),
    ],
)
def test_an_id_names_one_command_and_its_values(kind, fields, words):
    first = command(C.MOVE_ABSOLUTE, 5, **MOVE)
    state = keep_answer(held(), first, Answer(True, "done"))
    admission = admit(state, command(kind, 5, **fields), operator="li", now=at(0))
    if words:
        assert words in admission.answer.text
        assert [admission.repeat, admission.id_used, admission.answer.accepted] == [False] * 3
    else:
        assert admission.repeat
    late = command(C.MOVE_ABSOLUTE, 5, **MOVE)
    late.not_after.FromNanoseconds(1)
    assert admit(state, late, operator="li", now=at(9)).answer == Answer(True, "done")


def test_an_answer_is_not_kept_under_another_operators_lease():
    state = ask(held(), A.TAKE, "wang", reason="he left", secret="w").authority
    assert keep_answer(state, command(C.HOME, 9), Answer(True, "")) == state


def test_a_command_after_its_deadline_is_refused():
    late = command(C.HOME)
    late.not_after.FromNanoseconds(at(1).gateway_ns)
    assert admit(held(), late, operator="li", now=at(1)).answer.accepted
    refused = admit(held(), late, operator="li", now=at(1.5))
    assert "0.50 s after its not_after" in refused.answer.text
    assert refused.id_used


@pytest.mark.parametrize(
    ("kind", "longest_s"),
    [(C.MOVE_ABSOLUTE, 5), (C.JOG, 5), (C.RESET, 5), (C.RECOVER, 5), (C.RUN_PROGRAM, 65), (C.HOLD, 1e6)],
)
def test_a_deadline_further_ahead_than_the_command_may_wait_is_refused(kind, longest_s):
    far = command(kind)
    far.not_after.FromNanoseconds(at(0).gateway_ns + round(longest_s * 1e9))
    assert admit(held(), far, operator="li", now=at(0)).answer.accepted
    refused = admit(held(), far, operator="li", now=at(-1)).answer
    if kind == C.HOLD:  # it only ends motion
        assert refused.accepted
    else:
        assert refused.reason.code == "command.deadline_far"
        assert f"{longest_s + 1} s ahead of the gateway's time" in refused.text


def test_a_command_that_waited_over_a_second_is_not_sent():
    assert wait_refusal(at(0).monotonic_s, at(0.9)) is None
    assert wait_refusal(at(0).monotonic_s, at(6)).text.startswith("Not sent: it waited 6.0 s in the gateway")


def test_the_secret_is_not_in_the_leases_own_text():
    assert "s3cret" not in repr(ask(Authority(), A.ACQUIRE, secret="s3cret").authority)


requests = st.tuples(
    st.sampled_from([A.ACQUIRE, A.RENEW, A.RELEASE, A.OFFER, A.ACCEPT, A.TAKE]),
    st.sampled_from(["li", "wang", "zhao"]),
    st.sampled_from(["li", "wang", ""]),
    st.sampled_from(["", "because"]),
    st.booleans(),
    st.floats(0.0, 3.0),
)


@given(st.lists(requests, max_size=30))
def test_only_the_newest_granted_secret_holds(asked):
    authority, granted, time_s = Authority(), {}, 0.0
    for number, (action, operator, to, reason, knows, wait_s) in enumerate(asked):
        time_s += wait_s
        authority, _ = expire(authority, at(time_s))
        secret = granted.get(operator, "") if knows else ""
        outcome = ask(
            authority,
            action,
            operator,
            time_s=time_s,
            to=to,
            reason=reason,
            lease=secret,
            secret=f"#{number}",
        )
        authority = outcome.authority
        if outcome.granted is not None:
            granted[operator] = outcome.granted.secret
            assert outcome.granted.holder == operator
        holders = [name for name, known in granted.items() if holds(authority, name, known)]
        assert holders == ([authority.lease.holder] if authority.lease else [])
