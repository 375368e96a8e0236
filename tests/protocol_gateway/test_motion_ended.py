"""Proof that a motion has ended: the end of a lease stops the robot before it, and not after it."""

from dataclasses import replace

import pytest

from protocol_gateway.authority.audit_entry import GATEWAY
from protocol_gateway.authority.events import MotionObserved, StatusReported
from protocol_gateway.authority.lease_rules import Authority, Now, end_lease, request_lease
from protocol_gateway.authority.motion_owner import follow_motion, follow_status, record_command
from protocol_gateway.seam import Activity, Mode, StatusReceived
from robomesh import reason_codes as codes
from robomesh.schemas.robomesh_pb2 import CommandRequest, LeaseRequest
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of
from tests.protocol_gateway.control_bench import control_bench
from tests.protocol_gateway.gateway_site import gateway, simulator, until

A = LeaseRequest.Action
C = CommandRequest.Command
HOME = tuple(joints_of(load("pt600")).home.tolist())
HERE, THERE, ELSEWHERE = (0.0, 0.0), (1.0, 0.0), (0.0, 1.0)


def at(seconds):
    return Now(1000.0 + seconds, round((5000.0 + seconds) * 1e9), round((7000.0 + seconds) * 1e9))


def ask(authority, action, operator="li", **fields):
    request = LeaseRequest(action=action, **fields)
    return request_lease(authority, request, operator=operator, now=at(0), secret="s")


def command(state, kind, time_s, waypoints=(THERE,)):
    return record_command(state, CommandRequest(lease="s", command=kind), at(time_s), waypoints=waypoints)


def see(state, moves, time_s):
    return follow_motion(state, moving=moves, pending=False, arrived=not moves, now=at(time_s))[0]


def report(state, time_s, *, resting=True):
    return follow_status(state, resting=resting, dated_s=at(time_s).monotonic_s)


@pytest.fixture
def controlled():
    """Return a state in which li controls a robot at rest."""
    return ask(see(Authority(), False, -1.0), A.ACQUIRE).authority


@pytest.fixture
def at_rest(controlled):
    """Return a state after li's motion, with the robot just at rest."""
    return see(see(command(controlled, C.MOVE_ABSOLUTE, 0.0), True, 0.9), False, 1.0)


def stops(state):
    return end_lease(state, codes.ENDED_GATEWAY())[1].stop


def test_two_units_that_report_rest_at_the_target_prove_that_a_motion_has_ended(at_rest):
    once = report(at_rest, 1.0)
    assert stops(at_rest)
    assert stops(once)
    ended = report(once, 1.01)
    assert not stops(ended)
    assert not ask(ended, A.RELEASE, lease="s").ended.stop
    assert not ask(ended, A.TAKE, "wang", reason="lunch").ended.stop
    offered = ask(ended, A.OFFER, lease="s", to="wang").authority
    accepted = ask(offered, A.ACCEPT, "wang")
    assert accepted.granted.holder == "wang"
    assert not accepted.ended.stop
    refused = ask(ask(once, A.OFFER, lease="s", to="wang").authority, A.ACCEPT, "wang")
    assert "motion is still running" in refused.answer.text


def test_the_two_units_are_consecutive(at_rest):
    state = report(report(report(at_rest, 1.0), 1.01, resting=False), 1.02)
    assert stops(state)
    assert not stops(report(state, 1.03))


def test_units_from_before_the_last_motion_prove_nothing(at_rest):
    assert stops(report(report(at_rest, 0.8), 0.9))


def test_a_motion_that_was_never_seen_has_not_ended(controlled):
    state = see(command(controlled, C.HOME, 0.0), False, 0.1)
    assert stops(report(report(state, 0.2), 0.3))


def test_a_robot_that_moves_again_is_the_holders_until_it_rests(at_rest):
    state = see(report(report(at_rest, 1.0), 1.01), True, 1.1)
    assert stops(state)
    state = see(state, False, 1.2)
    assert stops(report(state, 1.21))
    assert not stops(report(report(state, 1.21), 1.22))


def test_a_new_motion_begins_the_proof_again(at_rest):
    state = command(report(report(at_rest, 1.0), 1.01), C.MOVE_ABSOLUTE, 1.1, waypoints=(ELSEWHERE,))
    assert stops(report(report(state, 1.2), 1.3))
    state = see(see(state, True, 1.9), False, 2.0)
    assert not stops(report(report(state, 2.1), 2.2))


def test_a_second_home_is_not_ended_by_the_first(controlled):
    state = see(command(controlled, C.MOVE_ABSOLUTE, 0.0, waypoints=(HERE,)), True, 0.1)
    state = see(see(command(state, C.HOME, 0.9, waypoints=(HERE,)), True, 1.0), False, 1.1)
    assert stops(report(report(state, 1.2), 1.3))
    assert see(state, False, 1.5).lease.motion is None  # 0.5 s later, as ever


def test_a_target_passed_twice_proves_nothing_at_first(controlled):
    state = command(controlled, C.MOVE_ABSOLUTE, 0.0, waypoints=(THERE,))
    state = command(
        command(state, C.MOVE_ABSOLUTE, 0.1, waypoints=(ELSEWHERE,)), C.MOVE_ABSOLUTE, 0.2, waypoints=(THERE,)
    )
    state = see(see(state, True, 0.9), False, 1.0)
    assert stops(report(report(state, 1.1), 1.2))


def test_a_queued_motion_has_ended_at_its_own_target(controlled):
    state = see(command(controlled, C.MOVE_ABSOLUTE, 0.0, waypoints=(THERE,)), True, 0.1)
    state = see(see(command(state, C.MOVE_ABSOLUTE, 0.2, waypoints=(ELSEWHERE,)), True, 1.9), False, 2.0)
    assert not stops(report(report(state, 2.1), 2.2))


def test_a_held_motion_has_not_ended_until_it_is_resumed_to_its_target(at_rest):
    held = command(report(report(at_rest, 1.0), 1.01), C.HOLD, 1.1)
    assert stops(report(report(held, 1.2), 1.3))
    resumed = see(see(command(held, C.RESUME, 2.0), True, 2.4), False, 2.5)
    assert not stops(report(report(resumed, 2.6), 2.7))


def test_rest_proves_nothing_if_the_robot_moved_before_the_command():
    moved = ask(see(Authority(), True, -1.0), A.ACQUIRE).authority
    state = see(see(command(moved, C.HOME, 0.0), True, 0.1), False, 0.2)
    assert stops(report(report(state, 0.3), 0.4))


@pytest.mark.parametrize(
    ("activity", "positions", "age_s", "latched"),
    [
        (Activity.IDLE, HOME, 0.0, False),
        (None, HOME, 0.0, True),
        (Activity.MOVING, HOME, 0.0, True),
        (Activity.IDLE, (0.1, *HOME[1:]), 0.0, True),
        (Activity.IDLE, HOME, 9.0, True),
    ],
)
async def test_releasing_control_stops_motion_without_proof_of_its_end(
    tmp_path, clock, activity, positions, age_s, latched
):
    async with control_bench(tmp_path) as bench:
        bench.status = StatusReceived(activity=Activity.IDLE, mode=Mode.REMOTE, homed=False)
        bench.control.handle(MotionObserved(False))
        await bench.lease(A.ACQUIRE)
        await bench.commands((C.HOME, {}))
        clock.advance(0.1)
        bench.control.handle(MotionObserved(True))
        bench.status, bench.positions = replace(bench.status, activity=activity, homed=True), positions
        clock.advance(0.1)
        bench.control.handle(MotionObserved(False))
        for _ in range(2):
            clock.advance(0.01)
            bench.control.handle(StatusReported(activity, clock.now.monotonic_s - age_s))
        await bench.lease(A.RELEASE, lease=bench.secret)
        assert (bench.control.authority.stop is not None) is latched
        assert any(unit == b"1#COMMAND*stop@" for unit in bench.socket) is latched


async def test_releasing_control_at_home_stops_nothing(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        await site.lease(A.RELEASE)
        await until(lambda: not site.seen["lease"][-1].holder)
        await site.units(3)
        assert [each.request for each in site.seen["audit"] if each.operator == GATEWAY] == []
        assert site.controller.stop.id == 0
