import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.unit.driver import UNITS, UnitDriver
from protocol_gateway.seam import (
    Activity,
    Hold,
    Home,
    JointsReceived,
    MalformedReceived,
    Mode,
    MoveAbsolute,
    MoveRelative,
    Refused,
    Reset,
    Resume,
    Speed,
    StatusReceived,
    Stop,
    Trace,
    UnknownReceived,
)
from protocol_gateway.seam.errors import CommandError
from robots.kinematics.joints import JointType

R, P = JointType.ROTARY, JointType.PRISMATIC

COMMANDS = [
    (Home(), b"1#COMMAND*home@"),
    (Hold(), b"1#COMMAND*hold@"),
    (Resume(), b"1#COMMAND*resume@"),
    (Reset(), b"1#COMMAND*reset@"),
    (Stop(), b"1#COMMAND*stop@"),
    (Trace(True), b"1#COMMAND*trace@"),
    (Trace(False), b"1#COMMAND*untrace@"),
    (Speed(50.0), b"1#COMMAND*speed=50.00@"),
    (MoveAbsolute((math.pi / 2, 0.25)), b"1#ABSOLUTE.DEG*90.00;250.00@"),
    (MoveRelative((-math.pi, 0.0)), b"1#RELATIVE.DEG*-180.00;0.00@"),
]


def driver(**settings) -> UnitDriver:
    return UnitDriver((R, P), **settings)


@pytest.mark.parametrize(("command", "data"), COMMANDS)
def test_commands_are_encoded_in_the_papers_words_and_units(command, data):
    assert driver().prepare(command) == data


@pytest.mark.parametrize(
    ("codes", "can_stop"),
    [
        ({}, True),
        ({2: "ABSOLUTE.DEG", 1: "COMMAND"}, True),
        ({2: "ABSOLUTE.DEG", 102: "COMMAND:stop"}, True),
        ({2: "ABSOLUTE.DEG", 101: "COMMAND:home"}, False),
    ],
)
def test_a_controller_of_codes_needs_a_code_for_stop(codes, can_stop):
    assert (Stop in driver(codes=codes).capabilities.commands) is can_stop


def test_commands_are_encoded_in_the_site_files_codes():
    coded = driver(codes={2: "ABSOLUTE.DEG", 102: "COMMAND:stop"})
    assert coded.prepare(Stop()) == b"1#102@"
    assert coded.prepare(MoveAbsolute((0.0, 0.0))) == b"1#2*0.00;0.00@"


@pytest.mark.parametrize(
    "command",
    [MoveAbsolute((1.0,)), MoveRelative((1.0, 2.0, 3.0)), MoveAbsolute((math.nan, 0.0)), Speed(math.inf)],
)
def test_an_inexpressible_command_is_refused(command):
    with pytest.raises(CommandError):
        driver().prepare(command)


def test_positions_are_si_with_velocities_and_time():
    report = driver().read(
        b"4#ABSOLUTE.DEG*180.00;1000.00&VELOCITY.DEG*90.00;10.00&STATUS*moving;remote;homed&TIME*1.50@"
    )
    joints, status = report.events
    assert joints == JointsReceived((math.pi, 1.0), (math.pi / 2, 0.01), 1.5)
    assert status == StatusReceived(Activity.MOVING, Mode.REMOTE, True, False, 1.5)


def test_the_papers_controllers_send_positions_only():
    assert driver().read(b"1#ABSOLUTE.DEG*180;0@").events == [JointsReceived((math.pi, 0.0), None, None)]


def test_a_status_without_activity_or_mode_leaves_them_unknown():
    assert driver().read(b"1#STATUS*trace@").events == [StatusReceived(None, None, False, True, None)]


@pytest.mark.parametrize(
    ("words", "activity", "mode"),
    [
        ("idle;local;remote", Activity.IDLE, Mode.LOCAL),
        ("idle;remote;local", Activity.IDLE, Mode.LOCAL),
        ("idle;remote;remote;idle", Activity.IDLE, Mode.REMOTE),
        ("idle;moving", None, None),
        ("stopped;idle", Activity.STOPPED, None),
        ("idle;stopped", Activity.STOPPED, None),
        ("fault;stopped;moving", Activity.FAULT, None),
    ],
)
def test_of_contradictory_words_the_one_that_forbids_motion_counts(words, activity, mode):
    (status,) = driver().read(f"1#STATUS*{words}@".encode()).events
    assert (status.activity, status.mode) == (activity, mode)


def test_unknown_words_and_types_are_passed_on_raw():
    unit = b"4#STATUS*idle;sleepy&FORCE*1;2&COMMAND*home&RELATIVE.DEG*1.00;2.00"
    events = driver().read(unit + b"@").events
    assert [event.type for event in events if isinstance(event, UnknownReceived)] == [
        "STATUS",
        "FORCE",
        "COMMAND",
        "RELATIVE.DEG",
    ]
    assert all(event.raw == unit for event in events if isinstance(event, UnknownReceived))
    assert not any(isinstance(event, JointsReceived) for event in events)


def test_units_of_refusals_are_counted_separately():
    report = driver().read(b"2#ERROR*5;a&ERROR*5;b@" + b"2#STATUS*idle&ERROR*5@" + b"1#TIME*1@" + b"x@")
    assert (report.units, report.refusals) == (3, 1)


def test_a_refusal_comes_with_its_number_and_text():
    assert driver().read(b"1#ERROR*5;joint waist@").events == [Refused(5, "joint waist")]


@pytest.mark.parametrize(
    "unit",
    [b"1#ABSOLUTE.DEG*1;2;3@", b"2#ABSOLUTE.DEG*1;2&VELOCITY.DEG*1@", b"2#STATUS*idle&ABSOLUTE.DEG*1@"],
)
def test_a_unit_of_another_joint_count_is_rejected(unit):
    report = driver().read(b"1#TIME*1.00@" + unit)
    (event,) = report.events[1:]
    assert isinstance(event, MalformedReceived)
    assert event.offset == 12
    assert "the description has 2" in event.reason
    assert event.joint_count
    assert report.units == 1


def test_a_new_connection_discards_an_unfinished_unit():
    fresh = driver()
    fresh.read(b"1#ABSOLUTE.DEG*1;")
    fresh.opened(UNITS, 0.0)
    assert fresh.read(b"2@1#ABSOLUTE.DEG*0;0@").events[1:] == [JointsReceived((0.0, 0.0))]


@given(st.binary(max_size=300))
def test_any_bytes_give_events_but_no_invented_joints(data):
    for event in driver().read(data).events:
        assert not isinstance(event, JointsReceived) or b"ABSOLUTE.DEG" in data or b"2" in data


@given(st.lists(st.floats(-360, 360), min_size=2, max_size=2).map(tuple))
def test_positions_survive_a_round_trip(positions):
    fresh = driver()
    (joints,) = fresh.read(fresh.prepare(MoveAbsolute(positions))).events
    assert joints.positions == pytest.approx(positions, abs=1e-10)
