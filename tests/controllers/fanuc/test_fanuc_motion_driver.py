"""Driver of FANUC's motion, without sockets: messages, their reading, and what forbids a motion."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.fanuc.axes import Axes, FanucSettings
from controllers.fanuc.rmi import messages as rmi
from controllers.fanuc.rmi.motion_driver import (
    RMI,
    SESSION,
    FanucMotionDriver,
    fanuc_driver,
)
from controllers.fanuc.table import Fanuc
from protocol_gateway.seam import (
    Activity,
    FateUnknown,
    FollowsControl,
    Hold,
    JointsReceived,
    Mode,
    MoveAbsolute,
    Open,
    Reset,
    Send,
    Speed,
    StatusReceived,
    Stop,
    StopEnds,
)
from protocol_gateway.seam.errors import CommandError, GatewaySettingsError, NotReadyError
from robots.kinematics.joints import JointType

TYPES = (JointType.ROTARY,) * 6
SETTINGS = FanucSettings(assignments="own", j23=1, motion=True)
HERE = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
IDLE = StatusReceived(Activity.IDLE, Mode.REMOTE)
CONNECTED = b'{"Communication" : "FRC_Connect", "ErrorID" : 0, "PortNumber" : 16002, "MajorVersion" : 7} \r\n'
INITIALIZED = b'{"Command": "FRC_Initialize", "ErrorID": 0, "GroupMask": 1}\r\n'
ABORTED = b'{"Command": "FRC_Abort", "ErrorID": 2556937}\r\n'
DONE = b'{"Instruction": "FRC_JointMotionJRep", "ErrorID": 0, "SequenceID": 1}\r\n'


def ready(settings=SETTINGS, status=IDLE):
    """Return a driver that may move the arm at 1 s."""
    driver = FanucMotionDriver(TYPES, {}, options=settings)
    driver.started(0.0)
    assert Open(RMI, 16001) in driver.controlled(True, 0.0)
    driver.opened(RMI, 0.0)
    assert Open(SESSION, 16002) in driver.received(RMI, CONNECTED, 0.0)
    driver.opened(SESSION, 0.0)
    driver._noted(JointsReceived(HERE), 0.9, 1.0)
    driver._noted(status, 0.9, 1.0)
    return driver


def sent(effects):
    return [each.data for each in effects if isinstance(each, Send)]


def test_capabilities_say_what_was_never_tried():
    found = ready().capabilities
    assert (found.experimental, found.dies_with_link, found.stop_ends) == (True, False, StopEnds.OURS)
    assert found.stop_means == "FRC_Abort of RMI"
    assert isinstance(ready(), FollowsControl)


def test_nothing_is_opened_but_snpx_without_control():
    driver = FanucMotionDriver(TYPES, {}, options=SETTINGS)
    opened = [each.channel.name for each in driver.started(0.0) if isinstance(each, Open)]
    assert opened == ["snpx"]
    assert driver.controlled(False, 0.0) == ()


@given(
    st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6),
    st.sampled_from([-1, 0, 1]),
    st.sets(st.integers(1, 6)),
    st.lists(st.floats(-180.0, 180.0), min_size=6, max_size=6),
)
def test_targets_undo_what_reading_does(target, j23, reversed_, zero):
    settings = replace(SETTINGS, j23=j23, reversed=tuple(reversed_), zero=zero)
    driver = ready(settings)
    driver.command(driver.prepare(Speed(50.0), MoveAbsolute(tuple(target))), 1.0)
    (line,) = sent(driver.received(SESSION, INITIALIZED, 1.1))
    packet = json.loads(line)
    assert list(packet) == [
        *("Instruction", "SequenceID", "JointAngle", "SpeedType", "Speed", "TermType", "TermValue")
    ]
    assert (packet["SequenceID"], packet["SpeedType"], packet["Speed"], packet["TermType"]) == (
        *(1, "Percent", 10, "FINE"),
    )
    axes = [packet["JointAngle"][f"J{number}"] for number in range(1, 10)]
    assert Axes(settings, TYPES).positions(axes) == pytest.approx(target, abs=1e-12)
    assert np.isfinite(axes).all()


def test_a_motion_is_sent_once_and_ends_with_an_abort():
    driver = ready()
    assert sent(driver.command(driver.prepare(MoveAbsolute(HERE)), 1.0)) == [rmi.initialize(1)]
    assert len(sent(driver.received(SESSION, INITIALIZED, 1.1))) == 1
    assert not sent(driver.received(SESSION, INITIALIZED, 1.2))
    assert sent(driver.received(SESSION, DONE, 1.3)) == [rmi.abort()]
    assert not sent(driver.received(SESSION, DONE, 1.4))


def test_a_stop_before_the_motion_was_sent_discards_it():
    driver = ready()
    driver.command(driver.prepare(MoveAbsolute(HERE)), 1.0)
    assert sent(driver.command(driver.prepare(Stop()), 1.05)) == [rmi.abort()]
    # The controller aborted before it created the program, so a second abort ends the program.
    driver.received(SESSION, ABORTED, 1.06)
    assert sent(driver.received(SESSION, INITIALIZED, 1.1)) == [rmi.abort()]


def activity(driver, now_s, joints=HERE):
    """Return the reported activity of a controller that says that no program runs."""
    driver._noted(JointsReceived(joints), now_s, now_s)
    return driver._noted(IDLE, now_s, now_s).activity


def test_a_stop_of_an_arm_at_rest_does_not_make_it_move():
    driver = ready()
    activity(driver, 1.5)
    driver.command(driver.prepare(Stop()), 1.6)
    # The abort is not answered yet.
    assert activity(driver, 1.61) is Activity.IDLE
    driver.received(SESSION, ABORTED, 1.62)
    assert activity(driver, 1.65) is Activity.IDLE


def test_a_stop_of_a_motion_that_has_not_begun_is_proven_by_rest_after_it():
    driver = ready()
    activity(driver, 1.5)
    driver.command(driver.prepare(MoveAbsolute(HERE)), 1.5)
    driver.received(SESSION, INITIALIZED, 1.6)
    driver.command(driver.prepare(Stop()), 1.61)
    driver.received(SESSION, ABORTED, 1.62)
    assert activity(driver, 1.65) is Activity.MOVING
    assert activity(driver, 1.9, (*HERE[:5], 0.7)) is Activity.MOVING
    assert activity(driver, 2.3, (*HERE[:5], 0.7)) is Activity.MOVING
    assert activity(driver, 2.5, (*HERE[:5], 0.7)) is Activity.IDLE


@pytest.mark.parametrize("resets", [(), (Reset(),), (Reset(), MoveAbsolute(HERE))])
def test_a_stop_that_was_not_delivered_is_sent_later_unless_a_reset_was_accepted(resets):
    driver = ready()
    driver.closed(SESSION, 1.0)
    driver.command(driver.prepare(Stop()), 1.1)
    if len(resets) == 2:
        with pytest.raises(NotReadyError):
            driver.command(driver.prepare(*resets), 1.2)
    elif resets:
        driver.command(driver.prepare(*resets), 1.2)
    driver.timer_ended({"reopen": 10.0}, 10.0)
    driver.opened(RMI, 10.1)
    driver.received(RMI, CONNECTED, 10.2)
    assert sent(driver.opened(SESSION, 10.3)) == ([] if len(resets) == 1 else [rmi.abort()])


@pytest.mark.parametrize(
    ("status", "code"),
    [
        (StatusReceived(Activity.MOVING, Mode.REMOTE), "fanuc.other_program"),
        (StatusReceived(Activity.HOLDING, Mode.REMOTE), "fanuc.arm_stopped"),
        (StatusReceived(Activity.FAULT, Mode.REMOTE), "fanuc.arm_stopped"),
        (StatusReceived(None, Mode.REMOTE), "fanuc.arm_stopped"),
        (StatusReceived(Activity.IDLE, Mode.LOCAL), "controller.local"),
        (StatusReceived(Activity.IDLE, None), "controller.mode_unknown"),
    ],
)
def test_a_state_that_forbids_motion(status, code):
    driver = ready(status=status)
    with pytest.raises(NotReadyError) as refused:
        driver.command(driver.prepare(MoveAbsolute(HERE)), 1.0)
    assert refused.value.reason.code == code


def test_an_old_state_and_an_extra_axis_forbid_motion():
    driver = ready()
    with pytest.raises(NotReadyError) as refused:
        driver.command(driver.prepare(MoveAbsolute(HERE)), 1.8)
    assert refused.value.reason.code == "fanuc.state_old"
    driver._axes_read = (*[10.0] * 6, 0.5, 0.0, 0.0)
    with pytest.raises(NotReadyError) as refused:
        driver.command(driver.prepare(MoveAbsolute(HERE)), 1.0)
    assert refused.value.reason.code == "fanuc.extra_axes"


@pytest.mark.parametrize("fresh", [JointsReceived(HERE), IDLE])
def test_old_positions_or_an_old_status_forbid_the_motion_that_waited_for_its_initialization(fresh):
    driver = ready()
    driver.command(driver.prepare(MoveAbsolute(HERE)), 1.0)
    driver._noted(fresh, 2.4, 2.4)
    effects = driver.received(SESSION, INITIALIZED, 2.5)
    assert sent(effects) == [rmi.abort()]
    assert [each.why.code for each in effects if isinstance(each, FateUnknown)] == ["fanuc.state_old"]


@pytest.mark.parametrize(
    "commands",
    [
        (MoveAbsolute(HERE[:5]),),
        (MoveAbsolute((*HERE[:5], float("nan"))),),
        (MoveAbsolute(HERE), Speed(1.0)),
        (Hold(),),
    ],
)
def test_what_cannot_be_expressed_is_refused(commands):
    with pytest.raises(CommandError):
        ready().prepare(*commands)


@pytest.mark.parametrize(
    "line",
    [
        *(b"", b"[]", b"{}", b"1", b'{"Command": "FRC_Reset", "ErrorID": 0}', b"\xff"),
        b'{"ErrorID": 0, "Command": "FRC_Abort", "Instruction": "FRC_Abort"}',
        b'{"Communication": "FRC_Abort", "ErrorID": 0}',
        b'{"Command": "FRC_Abort"}',
        b'{"Command": "FRC_Abort", "ErrorID": true}',
        b'{"Command": "FRC_Abort", "ErrorID": 0.0}',
        b'{"Command": "FRC_Abort", "ErrorID": 0, "ErrorID": 1}',
        b'{"Command": "FRC_Abort", "ErrorID": 2147483648}',
        b'{"Command": "FRC_Abort", "ErrorID": 0, "a": NaN}',
        b'{"Instruction": "FRC_JointMotionJRep", "ErrorID": 0}',
        b'{"Communication": "FRC_Connect", "ErrorID": 0, "PortNumber": 70000, "MajorVersion": 7}',
        b"[" * 4000,
    ],
)
def test_what_is_not_a_message_is_refused(line):
    with pytest.raises(ValueError, match=r"."):
        rmi.read(line)


def test_motion_needs_what_it_is_followed_by():
    with pytest.raises(GatewaySettingsError, match="needs assignments and j23"):
        fanuc_driver(TYPES, {}, relay=None, options=FanucSettings(motion=True))
    with pytest.raises(ValueError, match="a rate of at least 5"):
        Fanuc(assignments="own", j23=1, motion=True, rate=2)
    assert not fanuc_driver(TYPES, {}, relay=None, options=None).capabilities.commands
