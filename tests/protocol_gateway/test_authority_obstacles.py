"""Preconditions of commands, and detection of motion in positions."""

from dataclasses import replace
from math import radians

import pytest

from protocol_gateway.authority.preconditions import (
    ControllerState,
    commands_of,
    controller_command,
    controller_commands,
    recoveries_of,
    refusal_now,
)
from protocol_gateway.link.link import LinkState, LinkStatus
from protocol_gateway.link.motion import MotionDetector, has_arrived, is_moving, motion_may_be_held
from protocol_gateway.seam import (
    Activity,
    Capabilities,
    Mode,
    MoveAbsolute,
    MoveRelative,
    Recover,
    Recovery,
    Speed,
    StatusReceived,
    Stop,
    Trace,
)
from robomesh import reason_codes as codes
from robomesh.schemas.robomesh_pb2 import CommandRequest
from robomesh.schemas.robomesh_pb2 import Recover as RecoverMessage
from robots.descriptions.description import load
from robots.kinematics.joints import JointType, joints_of

C = CommandRequest.Command
JOINTS = joints_of(load("pt600"))
HOME = tuple(JOINTS.home.tolist())
TYPES = (JointType.ROTARY, JointType.PRISMATIC)
READY = ControllerState(
    link=LinkStatus(LinkState.UP, codes.LINK_CONNECTED(where="there")),
    status=StatusReceived(activity=Activity.IDLE, mode=Mode.REMOTE, homed=True, trace=False),
    positions=HOME,
)


def in_state(**status):
    return replace(READY, status=replace(READY.status, **status))


def linked(state):
    return replace(READY, link=LinkStatus(state, codes.LINK_LOST(codes.LINK_CLOSED_THERE(), where="there")))


def command(kind, **fields):
    if kind in (C.MOVE_ABSOLUTE, C.MOVE_RELATIVE):
        fields.setdefault("joint_positions", HOME if kind == C.MOVE_ABSOLUTE else [0] * 5)
    if kind == C.SPEED:
        fields.setdefault("speed_percent", 50)
    return CommandRequest(command=kind, **fields)


SITUATIONS = {
    "ready": READY,
    "link down": linked(LinkState.DOWN),
    "silent": linked(LinkState.SILENT),
    "read only": replace(READY, read_only=codes.STOP_NOT_PROVEN()),
    "stops and moves only": replace(
        READY, capabilities=Capabilities(commands=frozenset({Stop, MoveAbsolute}), absolute=True)
    ),
    "local": in_state(mode=Mode.LOCAL),
    "mode unknown": in_state(mode=None),
    "mode unknown, accepted": replace(in_state(mode=None), accept_unknown=frozenset({"mode"})),
    "stopped": in_state(activity=Activity.STOPPED),
    "fault": in_state(activity=Activity.FAULT),
    "holding": in_state(activity=Activity.HOLDING),
    "moving": in_state(activity=Activity.MOVING),
    "not homed": in_state(homed=False),
    "homed unknown": in_state(homed=None),
    "homed unknown, accepted": replace(in_state(homed=None), accept_unknown=frozenset({"homed"})),
    "not homed, unknown accepted": replace(in_state(homed=False), accept_unknown=frozenset({"homed"})),
    "joints unproven": replace(READY, positions=None, unproven=codes.JOINTS_NOT_VERIFIED(robot="arm")),
}

ALL = [
    "HOME",
    "HOLD",
    "RESUME",
    "RESET",
    "TRACE_ON",
    "TRACE_OFF",
    "SPEED",
    "MOVE_ABSOLUTE",
    "MOVE_RELATIVE",
]
AT_REST = [name for name in ALL if name != "RESUME"]


@pytest.mark.parametrize(
    ("situation", "allowed"),
    [
        ("ready", AT_REST),
        ("link down", []),
        ("silent", []),
        ("read only", []),
        ("stops and moves only", ["MOVE_ABSOLUTE", "MOVE_RELATIVE"]),
        ("local", []),
        ("mode unknown", ["HOLD"]),
        ("mode unknown, accepted", AT_REST),
        ("stopped", ["HOLD", "RESET", "TRACE_ON", "TRACE_OFF", "SPEED"]),
        ("fault", ["HOLD", "RESET", "TRACE_ON", "TRACE_OFF", "SPEED"]),
        ("holding", ["HOLD", "RESUME", "RESET", "TRACE_ON", "TRACE_OFF", "SPEED"]),
        ("moving", ALL),
        ("not homed", ["HOME", "HOLD", "RESET", "TRACE_ON", "TRACE_OFF", "SPEED"]),
        ("homed unknown", ["HOME", "HOLD", "RESET", "TRACE_ON", "TRACE_OFF", "SPEED"]),
        ("homed unknown, accepted", AT_REST),
        ("not homed, unknown accepted", ["HOME", "HOLD", "RESET", "TRACE_ON", "TRACE_OFF", "SPEED"]),
        ("joints unproven", ["HOLD", "RESET", "TRACE_ON", "TRACE_OFF", "SPEED"]),
    ],
)
def test_allowed_commands_in_each_state_of_the_controller(situation, allowed):
    found = [name for name in ALL if not refusal_now(command(C.Value(name)), SITUATIONS[situation], JOINTS)]
    assert found == allowed


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (command(C.SPEED, speed_percent=0), "speed 0 % is outside 1 to 100 %"),
        (command(C.SPEED, speed_percent=100.5), "speed 100.5 % is outside 1 to 100 %"),
        (CommandRequest(command=C.SPEED), "SPEED needs speed_percent, from 1 to 100"),
        (command(C.MOVE_ABSOLUTE, joint_positions=[0] * 6), "6 joint positions, but the robot has 5 joints"),
        (command(C.MOVE_ABSOLUTE, joint_positions=[float("nan")] * 5), "not a finite number"),
        (
            command(C.MOVE_ABSOLUTE, joint_positions=[radians(151), 0, 0, 0, 0]),
            "Not sent: joint waist at 151.00° is beyond its limit 150.00°.",
        ),
        (
            command(C.MOVE_ABSOLUTE, joint_positions=[0, radians(120), radians(60), 0, 0]),
            "shoulder + elbow at 180.00° is beyond its limit 160.00°",
        ),
        (command(C.MOVE_RELATIVE, joint_positions=[0, radians(41), 0, 0, 0]), "joint shoulder at 131.00°"),
        (
            command(C.MOVE_ABSOLUTE, joint_positions=[1e308, 0, 0, 0, 0]),
            "joint waist at 1e+308 rad is beyond its limit 150.00°",
        ),
    ],
)
def test_a_refused_value_is_named_with_the_allowed_ones(asked, words):
    assert words in refusal_now(asked, READY, JOINTS).text


def test_what_the_driver_does_not_have_is_refused_in_words():
    few = SITUATIONS["stops and moves only"]
    assert "this controller has no HOLD" in refusal_now(command(C.HOLD), few, JOINTS).text
    assert "its encoders are absolute" in refusal_now(command(C.HOME), few, JOINTS).text
    assert set(commands_of(few)) == {C.MOVE_ABSOLUTE, C.MOVE_RELATIVE, C.RUN_PROGRAM}


RECOVERABLE = replace(
    in_state(activity=Activity.STOPPED),
    capabilities=Capabilities(
        commands=frozenset({Stop}), recoveries=frozenset({Recovery.POWER_ON, Recovery.BRAKE_RELEASE})
    ),
    recover=frozenset({Recovery.POWER_ON}),
)


def recover(recovery=RecoverMessage.POWER_ON, reason="the fuse was changed", looked=True):
    return CommandRequest(
        command=C.RECOVER, recover=RecoverMessage(recovery=recovery, reason=reason, looked=looked)
    )


@pytest.mark.parametrize(
    ("request_", "controller", "code"),
    [
        (recover(), RECOVERABLE, None),
        (recover(), replace(RECOVERABLE, stop_arrives=False, positions=None), None),
        (recover(), READY, codes.RECOVER_NOT_THERE),
        (recover(RecoverMessage.SERVO_ON), RECOVERABLE, codes.RECOVER_NOT_THERE),
        (CommandRequest(command=C.RECOVER), RECOVERABLE, codes.RECOVER_NOT_THERE),
        (recover(RecoverMessage.BRAKE_RELEASE), RECOVERABLE, codes.RECOVER_NOT_ALLOWED),
        (recover(reason=" "), RECOVERABLE, codes.RECOVER_REASON),
        (recover(looked=False), RECOVERABLE, codes.RECOVER_LOOKED),
        *(
            (recover(), replace(RECOVERABLE, status=replace(READY.status, **status)), code)
            for status, code in (
                ({"mode": Mode.LOCAL}, codes.CONTROLLER_LOCAL),
                ({"mode": None}, codes.CONTROLLER_MODE_UNKNOWN),
                ({"activity": Activity.MOVING}, codes.RECOVER_MOVES),
                ({"activity": Activity.HOMING}, codes.RECOVER_MOVES),
                ({"activity": Activity.HOLDING}, codes.RECOVER_HELD),
                ({"activity": Activity.FAULT}, None),
            )
        ),
        (recover(), replace(RECOVERABLE, read_only=codes.STOP_NOT_PROVEN()), codes.ROBOT_READ_ONLY),
        (recover(), replace(RECOVERABLE, link=SITUATIONS["silent"].link), codes.LINK_SILENT),
    ],
)
def test_a_recovery_is_refused_by_site_file_state_and_missing_words(request_, controller, code):
    refusal = refusal_now(request_, controller, JOINTS)
    assert (refusal and _code(refusal)) == (code and code.name)


def _code(refusal):
    # Some refusals name the command, and have the reason as their cause.
    return refusal.reason.code


def test_only_allowed_recoveries_are_offered():
    assert commands_of(RECOVERABLE) == [C.RECOVER]
    assert recoveries_of(RECOVERABLE) == [RecoverMessage.POWER_ON]
    assert C.RECOVER not in commands_of(replace(RECOVERABLE, recover=frozenset()))
    assert controller_command(recover()) == Recover(Recovery.POWER_ON)


def test_a_driver_without_relative_motion_gets_targets():
    few = SITUATIONS["stops and moves only"]
    asked = [command(C.MOVE_RELATIVE, joint_positions=[0.1, 0, 0, 0, 0]) for _ in range(2)]
    once, twice = ((HOME[0] + 0.1 * times, *HOME[1:]) for times in (1, 2))
    assert refusal_now(asked[0], few, JOINTS) is None
    first, second = controller_commands(asked, few, JOINTS)
    assert (first.positions, second.positions) == (pytest.approx(once), pytest.approx(twice))
    assert controller_commands(asked[:1], READY, JOINTS) == [MoveRelative((0.1, 0, 0, 0, 0))]


def test_motion_is_refused_while_a_stop_could_not_be_sent():
    mute = replace(READY, stop_arrives=False)
    for kind in (C.HOME, C.MOVE_ABSOLUTE, C.MOVE_RELATIVE, C.RUN_PROGRAM):
        refusal = refusal_now(command(kind), mute, JOINTS)
        assert "a stop could not be sent" in refusal.text, kind
    for kind in (C.HOLD, C.RESET, C.SPEED):
        assert refusal_now(command(kind), mute, JOINTS) is None


def test_a_robot_without_positions_is_homed_but_not_moved():
    untold = replace(READY, positions=None)
    for kind in (C.MOVE_RELATIVE, C.MOVE_ABSOLUTE, C.RESUME):
        assert "has not reported joint positions" in refusal_now(command(kind), untold, JOINTS).text
    assert not refusal_now(command(C.HOME), untold, JOINTS)


def test_a_robot_with_stale_positions_is_not_even_homed():
    gone = replace(READY, positions=None, positions_stale=codes.POSITIONS_STALE(seconds=1.0))
    for kind in (C.MOVE_RELATIVE, C.MOVE_ABSOLUTE, C.RESUME, C.HOME):
        assert refusal_now(command(kind), gone, JOINTS).text == (
            "Not sent: the robot's position is unknown (no joint positions for 1 s)."
        )


def test_commands_become_the_drivers_own():
    assert controller_command(command(C.TRACE_OFF)) == Trace(on=False)
    assert controller_command(command(C.SPEED)) == Speed(percent=50.0)
    assert controller_command(command(C.MOVE_ABSOLUTE)) == MoveAbsolute(positions=HOME)


def watched(positions_at):
    detector = MotionDetector(TYPES)
    for number in range(200):
        detector.add(positions_at(number * 0.01), number * 0.01)
    return detector


@pytest.mark.parametrize(
    ("positions_at", "moving"),
    [
        (lambda t: (0.5, 0.1), False),
        (lambda t: (0.5 + radians(0.01) * (int(t * 100) % 2), 0.1), False),
        (lambda t: (0.5 + radians(0.5) * t, 0.1), True),
        (lambda t: (0.5, 0.1 + 0.001 * t), True),
        (lambda t: (0.5 + t if t < 1.0 else 1.5, 0.1), False),
    ],
)
def test_positions_show_motion_that_the_controller_does_not_report(positions_at, moving):
    assert is_moving(None, watched(positions_at)) is moving


def test_the_reported_activity_counts_before_positions():
    still, moving = watched(lambda t: (0.0, 0.0)), watched(lambda t: (t, 0.0))
    assert is_moving(Activity.HOMING, still) is True
    assert is_moving(Activity.IDLE, moving, reported_since_s=1.5) is False
    assert is_moving(Activity.IDLE, moving, reported_since_s=1.0) is True
    assert is_moving(None, MotionDetector(TYPES)) is None
    assert [motion_may_be_held(each) for each in (None, Activity.HOLDING, Activity.IDLE)] == [
        True,
        True,
        False,
    ]


def test_late_positions_of_a_stopped_motion_are_no_new_motion():
    """It would end the lease of an operator who has just reset the stop."""
    detector = watched(lambda t: (t, 0.0))
    stopped = {"activity": Activity.STOPPED, "reported_since_s": 2.0}
    assert is_moving(detector=detector, **stopped) is False
    for time_s in (3.2, 3.3):
        detector.add((2.1, 0.0), time_s)
        assert is_moving(detector=detector, **stopped) is False
    detector.add((2.2, 0.0), 3.4)
    assert is_moving(detector=detector, **stopped) is True


@pytest.mark.parametrize(
    ("target", "positions", "arrived"),
    [
        ((1.0, 0.5), (1.0009, 0.50009), True),
        ((1.0, 0.5), (1.0011, 0.5), False),
        ((1.0, 0.5), (1.0, 0.50011), False),
        (None, (1.0, 0.5), False),
        ((1.0, 0.5), None, False),
    ],
)
def test_a_robot_has_arrived_within_a_sensors_last_digit(target, positions, arrived):
    assert has_arrived(target, positions, TYPES) is arrived
