"""Files of FANUC's controllers: the values that are read, and the faults that are refused."""

import os
from functools import partial
from pathlib import Path

import pytest

from controllers.fanuc.axes import signal_bits
from controllers.fanuc.ftp import file_signals, files
from controllers.fanuc.ftp.files import ListedAlarm
from controllers.fanuc.ftp.protocol import Reply, ReplyStream, password, user
from protocol_gateway.seam import Activity, Mode
from tests.controllers.fanuc.ftp_site import (
    alarm,
    alarms,
    frames,
    io_state,
    position,
    read,
    registers,
    stop_signals,
)

AXES = ("-70.39", "-24.78", "-.65", ".15", "-89.38", "-.00")
PLACE = ("1505.56", "-1155.07", "165.31", ".08", "-.13", "-180.00")
FOLDERS = [Path(each) for each in os.environ.get("FANUC_BACKUPS", "").split(os.pathsep) if each]


@pytest.mark.parametrize("cfg_first", [True, False], ids=["V8 and later", "V7"])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_position_is_read_in_both_orders_and_with_both_ends_of_lines(cfg_first, newline):
    data = position((1, AXES, PLACE), cfg_first=cfg_first).replace("\n", newline).encode()
    found = read(files.position(1), data)
    assert found.axes == (-70.39, -24.78, -0.65, 0.15, -89.38, 0, 0, 0, 0)
    assert (found.count, found.frame, found.tool) == (6, 0, 1)
    assert found.place.values == (1505.56, -1155.07, 165.31, 0.08, -0.13, -180)
    assert found.place.configuration == "N U T, 0, 0, 0"
    assert found.software == "V9.30146 5/27/2021"


def test_group_is_the_declared_one_and_extended_axes_follow_the_joints():
    file = position((1, AXES, PLACE, ("-1444.07",), 4, 10), (2, ("12.50", "-.01"), None))
    first, second = read(files.position(1), file), read(files.position(2), file)
    assert (first.axes[6:], first.count, first.frame, first.tool) == ((-1444.07, 0, 0), 7, 4, 10)
    assert first.place is not None
    assert (second.axes[:3], second.count, second.place) == ((12.5, -0.01, 0), 2, None)
    with pytest.raises(ValueError, match="group 3 is not in the file; it has 1, 2"):
        read(files.position(3), file)


def test_number_that_does_not_fit_is_not_known():
    found = read(files.position(1), position((1, (*AXES[:5], "*" * 10), PLACE)))
    assert (found.axes, found.count) == (None, 6)
    assert read(files.position(1), position((1, AXES, ("*" * 10, *PLACE[1:])))).place is None


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: "", "group 1 is not in the file; it has none"),
        (lambda text: text[: len(text) // 3], "not whole"),
        (lambda text: text[: text.rindex("W:")], "not whole"),
        (lambda text: text.replace("Joint   3", "Joint   4"), "wrong order"),
        (lambda text: text.replace("-.65", "nan"), "no axis"),
        (lambda text: text.replace("-.65", "1e99"), "no axis"),
        (lambda text: text.replace("-89.38", "9" * 40 + ".0"), "no axis"),
        (lambda text: text.replace("Joint   1", "Joint   0"), "wrong order"),
        (
            lambda text: text.replace("Joint   6:", "Join  6:").replace(
                "Frame", "EXTAXS:  1: 9.00\nFrame", 1
            ),
            "order",
        ),
        (lambda text: text.replace("Y:", "Q:"), "no part of a position"),
        (lambda text: text.replace("Y:", "X:"), "wrong order"),
        (lambda text: text * 2, "group 1 is in the file twice"),
        (lambda text: text + position((2, AXES, PLACE)) * 2, "group 2 is in the file twice"),
        (lambda text: text.replace("CURRENT JOINT", "CURRENT WORLD"), "not whole"),
    ],
)
def test_broken_position_gives_nothing_but_its_fault(change, words):
    with pytest.raises(ValueError, match=words):
        read(files.position(1), change(position((1, AXES, PLACE))))


def test_alarms_have_code_text_and_severity_without_their_number():
    file = alarms(
        alarm("SRVO-037 IMSTP input (Group:2)"),
        alarm("PRIO-230 EtherNet/IP Adapter Error (1)", "WARN", "PRIO-233 EtherNet/IP Scn Not in Run Mode"),
    )
    assert read(files.active_alarms(), file) == [
        ListedAlarm("26-NOV-26 09:30:02", "SRVO-037 IMSTP input (Group:2)", "", "SERVO"),
        ListedAlarm(
            "26-NOV-26 09:30:02",
            "PRIO-230 EtherNet/IP Adapter Error (1)",
            "PRIO-233 EtherNet/IP Scn Not in Run Mode",
            "WARN",
        ),
    ]
    # A quotation mark in a text moves its rest into the cause, and nothing is lost.
    (quoted,) = read(files.active_alarms(), alarms(alarm('INTP-311 (A"B) Data', "")))
    assert quoted.message == "INTP-311 (A"
    assert quoted.cause.startswith("B) Data")
    assert quoted.severity == ""
    assert read(files.active_alarms(), alarms()) == []
    for wrong in (file.replace("ERRACT", "ERRALL"), "", file.replace("00110110", ""), alarms("17 \n")):
        with pytest.raises(ValueError, match="alarm"):
            read(files.active_alarms(), wrong)


def test_inputs_that_are_not_in_the_file_are_not_known():
    known = read(files.inputs_and_outputs(), io_state(DIN1=True, DIN2=False, DOUT81=True, RO3=True, UO2=True))
    assert files.values_of(signal_bits("DI[1-3]"), known) == [True, False, None]
    assert files.values_of(signal_bits("DO[80-81]"), known) == [None, True]
    assert files.values_of(signal_bits("RO[3]"), known) == [True]
    with pytest.raises(ValueError, match="no list of inputs"):
        read(files.inputs_and_outputs(), stop_signals())


WHOLE = {f"UO{number}": False for number in range(1, 11)}


@pytest.mark.parametrize(
    ("on", "activity", "mode"),
    [
        ({"UO1": True, "UO2": True}, Activity.IDLE, Mode.REMOTE),
        ({"UO1": True, "UO2": True, "UO3": True}, Activity.MOVING, Mode.REMOTE),
        ({"UO2": True, "UO4": True}, Activity.HOLDING, None),
        ({"UO6": True, "UO8": True}, Activity.FAULT, Mode.LOCAL),
        ({"UO2": True, "UO8": True}, None, Mode.LOCAL),
        ({}, Activity.STOPPED, None),
    ],
)
def test_status_is_that_of_the_operator_panel(on, activity, mode):
    status = file_signals.status_of(read(files.inputs_and_outputs(), io_state(**WHOLE | on)))
    assert (status.activity, status.mode) == (activity, mode)
    # Absolute encoders, except in a fault, which may be the loss of the position.
    assert status.homed is (None if activity is Activity.FAULT else True)


def test_status_is_unknown_where_outputs_are_not_assigned():
    """As in a controller that has only UO[1], UO[6], UO[9] and UO[10]: it does not say that nothing runs."""
    few = {"UO1": True, "UO6": False, "UO9": False, "UO10": False}
    for on, activity in ((few, None), (few | {"UO6": True}, Activity.FAULT), ({}, None)):
        status = file_signals.status_of(read(files.inputs_and_outputs(), io_state(**on)))
        assert (status.activity, status.mode) == (activity, None)
    assert not any(status.values)


def test_deadman_is_held_only_if_the_pendant_is_on():
    def enabling(**on):
        reported = file_signals.of_safety(read(files.safety(), stop_signals(**on)), 6.0)
        return {signal.name: value for signal, value in reported.values}

    assert enabling()["safety.enabling_device"] is None
    assert enabling(TP_Enable=True)["safety.enabling_device"] is True
    assert enabling(TP_Enable=True, TP_Deadman=True)["safety.enabling_device"] is False
    assert enabling(SOP_Estop=True)["safety.emergency_stop"] is True
    assert enabling(Fence_Open=True) == {
        "safety.emergency_stop": False,
        "safety.safeguard_stop": True,
        "safety.enabling_device": None,
    }


def test_registers_and_tools_are_those_of_the_variable():
    assert read(files.registers(), registers(R1="12", R2="-.364000", R3="Uninitialized", R4="1.030350")) == {
        1: 12.0,
        2: -0.364,
        3: None,
        4: 1.03035,
    }
    found = read(
        files.tools(1), frames(2, (1, 2, 3, 4, 5, 6), ("-1.5", "-.25", "0.000", "-90.000", "0.0", "45.0"))
    )
    assert found.active == 2
    assert found.frames[2].values == (-1.5, -0.25, 0, -90, 0, 45)
    assert read(files.tools(1), frames(1, (1, 2, 3, 4, 5, 6), group=2)).frames == {}
    for steps in (files.registers(), files.tools(1)):
        with pytest.raises(ValueError, match="it has no"):
            read(steps, position((1, AXES, PLACE)))


def test_replies_of_several_lines_end_with_their_own_code():
    stream = ReplyStream()
    assert stream.receive(b"220-R-30iB Plus\r\n150 no reply\r\n 220 no end\r\n220-more\r\n220 Re") == []
    assert stream.receive(b"ady.\r\n230 User logged in [NORM].\n") == [
        Reply(220, "Ready."),
        Reply(230, "User logged in [NORM]."),
    ]
    assert ReplyStream().receive(b"211-\r\n211\r\n") == [Reply(211, "")]
    for wrong in (b"hello\r\n", b"999 x\r\n", b"2" * 5000, b"220-\r\n" + b"x\r\n" * 300):
        with pytest.raises(ValueError, match=r"reply|line"):
            ReplyStream().receive(wrong)


@pytest.mark.parametrize(
    ("text", "port"),
    [
        ("Entering Passive Mode (10,0,0,7,4,1)", 1025),
        ("Entering Passive Mode (9,9,9,9,255,255)", 65535),
        ("=10,0,0,7,4,1", 1025),
        ("Entering Passive Mode (10,0,0,7,256,1)", None),
        ("Entering Passive Mode (10,0,0,7,0,0)", None),
        ("Entering Passive Mode", None),
    ],
)
def test_port_for_a_file_is_that_of_the_reply(text, port):
    assert Reply(227, text).port == port


def test_name_and_password_cannot_contain_another_command():
    assert (user("anonymous"), password("")) == (b"USER anonymous\r\n", b"PASS \r\n")
    for wrong in ("a\r\nDELE x", "a\n", "\0", "ä"):
        with pytest.raises(ValueError, match="printable ASCII"):
            password(wrong)


@pytest.mark.skipif(not FOLDERS, reason="FANUC_BACKUPS names no folder with files of a controller")
def test_files_of_real_controllers_are_read():
    steps = {
        "curpos.dg": partial(files.position, 1),
        "iostate.dg": files.inputs_and_outputs,
        "sftysig.dg": files.safety,
        "erract.ls": files.active_alarms,
        "numreg.va": files.registers,
        "sysframe.va": partial(files.tools, 1),
    }
    found = [each for folder in FOLDERS for each in folder.iterdir() if each.name.lower() in steps]
    assert found
    for each in found:
        name = each.name.lower()
        assert read(steps[name](), each.read_bytes()) or name == "erract.ls", each
