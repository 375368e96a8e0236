"""Packets, assignments, data and axes of SNPX.

The captured packets went between a GE driver (Kepware) and a controller of FANUC on port 18245; they were
published in Booozie-Z/Fanuc_GESRTP_Driver, docs/srtp packets.txt (MIT).
"""

import math
import re
import struct
from pathlib import Path

import numpy as np
import pytest

from controllers.fanuc import data as values
from controllers.fanuc.assignments import (
    FIRST_WORD,
    CurrentPosition,
    NumericRegister,
    Table,
    ToolFrame,
)
from controllers.fanuc.axes import Axes, FanucSettings, SignalBits, signal_bits
from controllers.fanuc.simulated import messages
from controllers.fanuc.srtp import (
    HEADER_BYTES,
    INLINE_BYTES,
    Answer,
    AnswerStream,
    Area,
    Assign,
    BeginSession,
    Clear,
    Connect,
    Read,
)
from protocol_gateway.seam.errors import GatewaySettingsError
from robots.kinematics.joints import JointType

SIX = (JointType.ROTARY,) * 6


def packet(text):
    return bytes.fromhex(text)


_ZEROS = "00 " * 7
_HEAD = "00 00 00 00 00 00 01 " + _ZEROS + "01 " + "00 " * 12
SESSION_ANSWER = packet(
    f"03 00 01 {_HEAD} 01 d4 10 0e 00 00 30 3a 00 00 01 01 00 00 00 00 00 00 01 01 ff 02 00 00 7c 21"
)
WORD_QUESTION = packet(
    f"02 00 ae {_HEAD} 06 c0 00 00 00 00 10 0e 00 00 01 01 04 0a 0a 00 01 00 00 00 00 00 00 00 00 00"
)
WORD_ANSWER = packet(
    f"03 00 ae {_HEAD} 06 d4 10 0e 00 00 30 3a 00 00 01 01 00 00 30 02 00 00 00 00 00 00 00 00 7c 21"
)
WORDS_ANSWER = (
    packet(f"03 00 06 00 50 00 00 00 00 01 {_ZEROS} 01 {'00 ' * 12} 06 94 10 0e 00 00 30 3a 00 00 01 01")
    + packet("00 00 00 00 00 00 01 01 ff 04 00 00 7c 21")
    + b"START PB".ljust(80, b"\0")
)
WRITE = packet(
    f"02 00 c1 00 04 00 00 00 00 02 {_ZEROS} 02 {'00 ' * 12} 09 80 00 00 00 00 10 0e 00 00 01 01"
    "04 00 00 00 00 00 01 01 07 08 f8 2a 02 00 61 64 62 00"
)
WRITE_ANSWER = packet(
    f"03 00 c1 {_HEAD} 09 d4 10 0e 00 00 30 3a 00 00 01 01 00 00 00 00 00 00 01 01 ff 04 00 00 7c 21"
)
REFUSAL = packet(
    f"03 00 06 {_HEAD} 09 d1 10 0e 00 00 30 3a 00 00 01 01 00 00 00 00 00 00 01 01 ff 04 00 00 7c 21"
)
# An R-30iB Plus, V9.30, answers 56 zeros so (eponce00/fanuc-snpx, docs/VALIDATION_LOG.md).
FIRST_ANSWER = bytes([1, *bytes(7), 1, *bytes(47)])


def received(data):
    return AnswerStream().receive(data)


# ----------------------------------------------------------------------- packets


def test_questions_have_the_form_of_captured_ones():
    asked = Read(Area.WORDS, 10, 1).encode(0xAE)
    expected = bytearray(WORD_QUESTION)
    # Kepware gives byte 30 a fixed number, and asks for %AI.
    expected[30], expected[43] = 0xAE, Area.WORDS
    assert asked == bytes(expected)
    command = Clear().encode(0xC1)
    expected = bytearray(WRITE)
    expected[30] = 0xC1
    # The size of the text, and its place.
    expected[4] = expected[42] = 6
    expected[51:56] = b"\x38\0\0\x06\0"
    assert command == bytes(expected[:56]) + b"CLRASG"


def test_a_connection_begins_with_zeros_and_a_session_as_other_clients_do():
    assert Connect().encode(0) == bytes(56)
    # As nerva, snpx-client and fanuc-ucl send it.
    assert BeginSession().encode(1) == packet(
        f"08 00 01 {_HEAD} 01 c0 00 00 00 00 10 0e 00 00 01 01 4f 01 00 00 00 00 00 00 00 00 00 00 00 00"
    )


def test_captured_answers_are_read():
    (session,) = received(SESSION_ANSWER)
    assert (session.number, session.refused, session.connected) == (1, False, False)
    (word,) = received(WORD_ANSWER)
    assert word.number == 0xAE
    assert word.read(Read(Area.WORDS, 10, 1)) == b"\x30\x02"
    (words,) = received(WORDS_ANSWER)
    assert words.read(Read(Area.WORDS, 2000, 40)).rstrip(b"\0") == b"START PB"
    (written,) = received(WRITE_ANSWER)
    assert not written.refused
    (refused,) = received(REFUSAL)
    assert (refused.refused, refused.busy, refused.error) == (True, False, "status 0x0000")
    (first,) = received(FIRST_ANSWER)
    assert first.connected
    assert (first.answers(Connect()), first.answers(BeginSession())) == (True, False)


def test_the_simulated_controllers_packets_are_those_captured():
    stream = messages.PacketStream()
    (question, written) = stream.receive(WORD_QUESTION + WRITE)
    assert messages.answer(question, b"\x30\x02") == WORD_ANSWER
    assert messages.answer(written) == WRITE_ANSWER
    assert written.text == b"adb\0"
    (question,) = messages.PacketStream().receive(WORDS_ANSWER[:1].replace(b"\3", b"\2") + WORD_QUESTION[1:])
    assert messages.answer(question, b"START PB".ljust(80, b"\0"))[31:] == WORDS_ANSWER[31:]
    assert messages.connected() == FIRST_ANSWER
    assert messages.refusal(written)[31:] == REFUSAL[31:]


def test_answers_split_at_every_byte_are_the_same():
    whole = FIRST_ANSWER + WORD_ANSWER + WORDS_ANSWER + REFUSAL
    expected = received(whole)
    assert len(expected) == 4
    for at in range(len(whole)):
        stream = AnswerStream()
        assert [*stream.receive(whole[:at]), *stream.receive(whole[at:])] == expected


@pytest.mark.parametrize(
    ("at", "value", "reason"),
    [
        (0, 5, "kind 5"),
        (31, 0x42, "type 0x42"),
        (41, 2, "packet 1 of 2"),
        (4, 9, "9 bytes of text in an answer of type 0xD4"),
        (3, 1, "number 430"),
        (2, 0, "number 0"),
    ],
)
def test_a_wrong_header_is_an_error_and_the_next_read_begins_anew(at, value, reason):
    broken = bytearray(WORD_ANSWER)
    broken[at] = value
    stream = AnswerStream()
    (error,) = stream.receive(bytes(broken) + b"rest")
    assert reason in str(error)
    assert [each.number for each in stream.receive(WORD_ANSWER)] == [0xAE]


def test_data_of_another_length_than_asked_for_are_an_error():
    (words,) = received(WORDS_ANSWER)
    (word,) = received(WORD_ANSWER)
    for answer, count in ((words, 39), (words, 1), (word, 40)):
        with pytest.raises(ValueError, match="were asked for"):
            answer.read(Read(Area.WORDS, 0, count))
    assert len(word.read(Read(Area.ROBOT_OUTPUTS, 6000, 48))) == INLINE_BYTES


def test_a_read_is_of_whole_bytes_and_within_one_answer():
    for area, first, count in ((Area.ROBOT_INPUTS, 1, 8), (Area.WORDS, 0, 513), (Area.WORDS, 65536, 1)):
        with pytest.raises(ValueError, match=r"bits are read|exceed one answer"):
            Read(area, first, count)


# ------------------------------------------------------------------------ assignments


def test_only_declared_pieces_are_assigned_and_each_text_is_finite():
    table = Table(2, (1, 10), (5, 200))
    commands = [each.command for each in table.assignments]
    assert commands[0] == f"SETASG {FIRST_WORD} 50 POS[G2:0] 0"
    pattern = (
        r"SETASG \d+ \d+ (POS\[G\d:0\]|PRG\[1\]|ALM\[1\]|R\[\d+\]|\$MNUTOOL\[\d,\d+\]@1\.26"
        r"|\$MCR\.\$GENOVERRIDE|\$VERSION|\$MNU(FRAME|TOOL)NUM\[\d\]|\$SNPX_PARAM\.\$VERSION) \d+"
    )
    assert all(re.fullmatch(pattern, each) for each in commands)
    ends = [each.first_word + each.variable.words for each in table.assignments]
    assert [each.first_word for each in table.assignments[1:]] == ends[:-1]
    assert all(len(str(each.variable)) <= 37 for each in table.assignments)
    largest = Table(8, range(1, 11), range(1, 61))
    assert len(largest.assignments) <= 80
    assert largest.assignments[-1].first_word + 1 <= 16_384
    assert all(Read(Area.WORDS, each.first_word - 1, each.words) for each in largest.blocks)
    assert 1001 <= table.assignments[-1].multiply <= 10_000


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: CurrentPosition(0),
        lambda: CurrentPosition(9),
        lambda: ToolFrame(1, 11),
        lambda: NumericRegister(10_001),
        lambda: Table(1, (1, 1), ()),
        lambda: Table(1, (), range(1, 62)),
    ],
)
def test_a_group_tool_or_register_that_cannot_be_is_refused(wrong):
    with pytest.raises(ValueError, match=r"must be|at most"):
        wrong()


def test_words_of_another_table_are_not_used():
    table, other = Table(1, (1,), ()), Table(1, (1,), (7,))
    block = table.position
    version = struct.pack("<i", 2 * block.assignments[-1].multiply)
    content = bytes(range(100))
    assert block.values(content + version) == {
        CurrentPosition(1): content,
        block.assignments[-1].variable: version,
    }
    for wrong in (2 * other.position.assignments[-1].multiply, 0, 1, -2, 2, 2**31 - 1):
        assert block.values(content + struct.pack("<i", wrong)) is None
    # Old software has no table for each connection.
    assert block.values(content + struct.pack("<i", block.assignments[-1].multiply)) is None


def test_the_table_for_the_pendant_is_that_of_the_documents():
    text = Path("docs/controllers/fanuc.md").read_text()
    rows = re.findall(r"^\| (\d+) \| (\d+) \| `([^`]+)` \| (\d+) \|$", text, re.MULTILINE)
    table = FanucSettings(assignments="pendant").table
    assert rows == [
        (str(each.first_word), str(each.variable.words), str(each.variable), str(each.multiply))
        for each in table.assignments
    ]


# ------------------------------------------------------------------------------- data


def position(axes=(0.0,) * 9, pose=(0.0,) * 6, configuration=(0, 0, 1, 1, 0, 0, 0), valid=(1, 1)):
    axes = (*axes, *(0.0,) * (9 - len(axes)))
    head = struct.pack("<9f8h", *pose, 0, 0, 0, *configuration, valid[0])
    return head + struct.pack("<9f6h", *axes, valid[1], 15, 15, 0, 0, 0)


def test_a_position_has_axes_and_a_pose_with_its_configuration():
    found = values.position(
        position((1.5, -2.0, 3.0), (100.0, -200.0, 300.0, 180.0, -90.0, 45.0), (1, 1, 0, 0, 0, -1, 1))
    )
    assert found.axes == (1.5, -2.0, 3.0, 0, 0, 0, 0, 0, 0)
    assert found.cartesian.values == (100.0, -200.0, 300.0, 180.0, -90.0, 45.0)
    assert found.cartesian.configuration == "F L D B, 0, -1, 1"


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_a_position_that_is_not_valid_or_not_finite_is_unknown(number):
    assert values.position(position(valid=(1, 0))).axes is None
    assert values.position(position(valid=(0, 1))).cartesian is None
    # Sources place the flag in different bytes of its word.
    assert values.position(position(valid=(256, -1))).axes is not None
    assert values.position(position((number,))).axes is None
    assert values.position(position(pose=(0, 0, 0, 0, number, 0))).cartesian is None


def alarm(code="SRVO-001", text="Operator panel E-stop", severity=54, name="SERVO", facility=11, number=1):
    message = f"{code} {text}".encode()
    head = struct.pack("<11h", facility, number, 0, 0, severity, 2026, 11, 26, 9, 30, 0)
    return head + message.ljust(80, b"\0") + b"".ljust(80, b"\0") + name.encode().ljust(18, b"\0")


EMPTY_ALARM = struct.pack("<11h", 0, 0, 0, 0, 128, *(0,) * 6) + bytes(178)


def test_active_alarms_are_read_and_empty_lines_are_none():
    (found,) = values.alarms(alarm() + EMPTY_ALARM * 3)
    assert (found.number, found.severity_name, found.time[:3]) == ("SRVO-001", "SERVO", (2026, 11, 26))
    (katakana,) = values.alarms(alarm(code="", text="", facility=2, number=7))
    assert katakana.number == "2-007"


def test_the_program_of_a_task_is_read():
    found = values.task(b"WELD".ljust(16, b"\0") + struct.pack("<2h", 42, 2) + b"MAIN".ljust(16, b"\0"))
    assert (found.program, found.line, found.state, found.caller) == ("WELD", 42, 2, "MAIN")


# ------------------------------------------------------------------------------- axes


@pytest.mark.parametrize(("j23", "third"), [(0, 10.0), (1, 40.0), (-1, -20.0)])
def test_axis_3_is_related_to_axis_2_as_declared_in_both_directions(j23, third):
    axes = Axes(FanucSettings(j23=j23), SIX)
    found = axes.positions((5.0, 30.0, 10.0, -40.0, 50.0, 60.0, 0, 0, 0))
    assert found == pytest.approx([math.radians(each) for each in (5, 30, third, -40, 50, 60)])
    assert axes.values(np.array(found)) == pytest.approx((5.0, 30.0, 10.0, -40.0, 50.0, 60.0, 0, 0, 0))


def test_ros_industrial_and_fanuc_ucl_add_axis_2_to_axis_3():
    # linkage_transform with J23_factor 1, and FanucDeg to AbsDeg: j3 = -15 + 25.
    third = Axes(FanucSettings(j23=1), SIX).positions((0, 25.0, -15.0, *(0,) * 6))[2]
    assert math.degrees(third) == pytest.approx(10.0)


def test_a_linear_joint_has_millimetres_and_joints_may_be_reversed_moved_and_exchanged():
    types = (JointType.PRISMATIC, JointType.ROTARY)
    axes = Axes(FanucSettings(j23=0, axes=(7, 1), reversed=(2,), zero=(100.0, 90.0)), types)
    found = axes.positions((30.0, 0, 0, 0, 0, 0, 250.0, 0, 0))
    assert found == pytest.approx((0.35, math.radians(60.0)))
    assert axes.values(np.array(found)) == pytest.approx((30.0, 0, 0, 0, 0, 0, 250.0, 0, 0))


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"axes": (1, 2)}, "2 values, but the model has 6 joints"),
        ({"zero": (0.0,) * 7}, "7 values"),
        ({"axes": (1, 2, 3, 4, 5, 5)}, "each of one joint"),
        ({"axes": (1, 2, 3, 4, 5, 10)}, "9 at most"),
        ({"reversed": (7,)}, "1 to 6"),
    ],
)
def test_settings_that_do_not_fit_the_model_are_refused(settings, problem):
    with pytest.raises(GatewaySettingsError, match=problem):
        Axes(FanucSettings(**settings), SIX)


def test_a_linear_axis_cannot_be_coupled():
    with pytest.raises(GatewaySettingsError, match="must be 0, because only rotary axes"):
        Axes(FanucSettings(j23=1), (JointType.ROTARY, JointType.ROTARY, JointType.PRISMATIC))


def test_inputs_and_outputs_are_declared_by_their_names_on_the_pendant():
    assert signal_bits("DI[1-16]") == SignalBits("DI", 1, 16)
    assert (signal_bits("DI[9]").area, signal_bits("DI[9]").first_bit) == (Area.ROBOT_INPUTS, 8)
    # Outputs of the robot are inputs of the PLC; UI and UO begin at 6001, RI and RO at 5001.
    assert (signal_bits("UO[1-20]").area, signal_bits("UO[1-20]").first_bit) == (Area.ROBOT_OUTPUTS, 6000)
    assert signal_bits("RI[2]").first_bit == 5001
    for wrong in ("DI[0]", "DI[16-1]", "DI[1-129]", "GI[1]", "DI1", "DI[1];R[1]", ""):
        with pytest.raises(GatewaySettingsError, match=r"as in DI\[1-16\]"):
            signal_bits(wrong)


def test_the_header_is_56_bytes():
    assert (
        len(Assign(Table(1, (), ()).assignments[0]).encode(1)) - len("SETASG 10001 50 POS[G1:0] 0")
        == HEADER_BYTES
    )
    assert Answer(7, 0xD1, 0x0700, b"").busy
