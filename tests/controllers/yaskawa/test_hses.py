"""Packets, data, axes and polling of HSES; bytes written by hand from the manual's tables."""

import math
import struct

import numpy as np
import pytest

from controllers.yaskawa import data as payloads
from controllers.yaskawa.axes import Axes, Coupling, YaskawaSettings, instance_of
from controllers.yaskawa.hses import Answer, Command, Read, Service, decode
from protocol_gateway.driver_parts.polling import TIMEOUT_S, Polling, Regular
from protocol_gateway.seam.errors import GatewaySettingsError
from robots.kinematics.joints import JointType

SIX = (JointType.ROTARY,) * 6
STATUS = Read(Command.STATUS, 1)
# The manual's example of reading the status.
QUESTION = b"YERC\x20\x00\x00\x00\x03\x01\x00\x00\x00\x00\x00\x0099999999\x72\x00\x01\x00\x00\x01\x00\x00"
ANSWER = b"YERC\x20\x00\x08\x00\x03\x01\x01\x00\x00\x00\x00\x8099999999\x81\x00\x00\x00\x00\x00\x00\x00"
STATUS_DATA = b"\xc4\x00\x00\x00\x40\x00\x00\x00"


def test_a_question_has_the_bytes_of_the_manual():
    assert STATUS.encode(0) == QUESTION
    one = Read(Command.IO, 1001, 1, Service.SINGLE).encode(255)
    assert one == QUESTION[:11] + b"\xff" + QUESTION[12:24] + b"\x78\x00\xe9\x03\x01\x0e\x00\x00"


def test_an_answer_gives_number_service_status_and_data():
    assert decode(ANSWER + STATUS_DATA) == Answer(0, 1, 0, 0, STATUS_DATA)
    busy = ANSWER[:6] + b"\0\0" + ANSWER[8:25] + b"\x1f\x01\0\xf1\xd8\0\0"
    assert (decode(busy).busy, decode(busy).error) == (
        True,
        "busy with another command (status 0x1F, 0xD8F1)",
    )
    assert decode(busy[:25] + b"\x28\0\0\0\0\0\0").error == "there is no such instance (status 0x28)"


@pytest.mark.parametrize(
    ("datagram", "reason"),
    [
        (b"", "0 bytes"),
        (ANSWER, "8 bytes of data are announced, 0 follow"),
        (ANSWER + STATUS_DATA + b"\0", "8 bytes of data are announced, 9 follow"),
        (b"YERD" + ANSWER[4:] + STATUS_DATA, "YERC"),
        (QUESTION, "division 1, kind 0"),
        (ANSWER[:12] + b"\x01\0\0\0" + ANSWER[16:] + STATUS_DATA, "block 1 is not the last"),
        (ANSWER[:24] + b"\x01" + ANSWER[25:] + STATUS_DATA, "no answer"),
        (ANSWER[:26] + b"\x03" + ANSWER[27:] + STATUS_DATA, "3 words"),
    ],
)
def test_a_datagram_that_is_no_answer_says_why(datagram, reason):
    with pytest.raises(ValueError, match=reason):
        decode(datagram)


@pytest.mark.parametrize("count", [6, 7, 8])
def test_a_position_has_six_to_eight_axes_and_no_other_length_is_used(count):
    data = struct.pack(f"<5I{count}i", 0, 0, 3, 0, 0, *range(-1, count - 1))
    assert payloads.position(data) == payloads.Position(0, 0, 3, 0, 0, tuple(range(-1, count - 1)))
    for other in (data[:-1], data + b"\0", b"", data[:19], data[:40], data + bytes(12)):
        with pytest.raises(ValueError, match="bytes"):
            payloads.position(other)


def test_status_job_system_torques_and_names_have_their_lengths():
    assert payloads.status(STATUS_DATA) == payloads.Status(0xC4, 0x40)
    job = b"WELD".ljust(32, b"\0") + struct.pack("<3I", 12, 3, 10_000)
    assert payloads.job(job) == payloads.Job("WELD", 12, 3, 10_000)
    system = b"DS2.07.00A.(JP/US)-00".ljust(24, b"\0") + b"ES0165D-A0*".ljust(16, b"\0") + b"12.34\0\0\0"
    assert payloads.system(system) == payloads.System("DS2.07.00A.(JP/US)-00", "ES0165D-A0*", "12.34")
    assert payloads.torques(struct.pack("<7i", *range(-3, 4))) == (-3, -2, -1, 0, 1, 2, 3)
    assert payloads.axis_names(b"S\0\0\0L\0\0\0U\0\0\0R\0\0\0B\0\0\0T\0\0\0\0\0\0\0") == (*"SLURBT", "")
    for read, wrong in (
        (payloads.status, b""),
        (payloads.job, job + b"\0"),
        (payloads.system, system[:-1]),
        (payloads.torques, bytes(20)),
        (payloads.axis_names, bytes(56)),
        (payloads.io_byte, b"\0\0"),
    ):
        with pytest.raises(ValueError, match=f"with {len(wrong)} bytes"):
            read(wrong)


@pytest.mark.parametrize("more", [0, 208])
def test_an_alarm_has_sub_codes_on_later_controllers(more):
    head = struct.pack("<3I", 4107, 3, 1) + b"2026/11/26 09:30" + "異常".encode("shift_jis").ljust(32, b"\0")
    assert payloads.alarm(head + bytes(more)) == payloads.Alarm(4107, 3, 1, "2026/11/26 09:30", "異常")
    with pytest.raises(ValueError, match="must be 60 or 268"):
        payloads.alarm(head + bytes(more) + b"\0")


def test_a_text_is_one_line_in_any_encoding():
    assert payloads.text(b"A\x1b[2J\nB\0rest") == "A [2J B"
    assert payloads.text(b"\xff\xfe\x80") == "???"


# ------------------------------------------------------------------------------ axes


def axes(*types, **settings):
    return Axes(YaskawaSettings(**settings), types or SIX)


def test_pulses_are_positions_with_sign_zero_order_and_units():
    arm = axes(
        JointType.ROTARY,
        JointType.PRISMATIC,
        pulses_per_degree=(-100.0, 50.0),
        axes=(3, 1),
        zero=(90.0, 20.0),
    )
    assert arm.positions((500, 7, 1000, 0, 0, 0)) == pytest.approx((math.radians(80.0), 0.030))
    assert arm.pulses(np.array(arm.positions((500, 7, 1000, 0, 0, 0)))) == (500, 0, 1000, 0, 0, 0, 0, 0)


def test_a_coupled_wrist_is_uncoupled():
    arm = axes(
        pulses_per_degree=(1000,) * 6,
        coupling=[
            Coupling(joint=5, by=4, pulses_per_degree=-10.0),
            Coupling(joint=6, by=4, pulses_per_degree=30.0),
            Coupling(joint=6, by=5, pulses_per_degree=-400.0),
        ],
    )
    # Ten degrees of joint 4 turn the axes of joints 5 and 6 too.
    assert arm.positions((0, 0, 0, 10_000, -100, 300)) == pytest.approx((0, 0, 0, math.radians(10), 0, 0))
    turned = np.radians([5, -6, 7, 80, -9, 100])
    assert arm.positions(arm.pulses(turned)) == pytest.approx(turned, abs=math.radians(0.001))


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"pulses_per_degree": (1.0,) * 5}, "pulses_per_degree has 5 values, but the model has 6"),
        ({"pulses_per_degree": (1.0,) * 6, "zero": (1.0,)}, "zero has 1 values"),
        ({"pulses_per_degree": (1.0,) * 5 + (0.0,)}, "none may be 0"),
        ({"pulses_per_degree": (1.0,) * 6, "axes": (1, 2, 3, 4, 5, 5)}, "each of one joint"),
        ({"pulses_per_degree": (1.0,) * 6, "axes": (1, 2, 3, 4, 5, 9)}, "8 at most"),
        (
            {
                "pulses_per_degree": (1.0,) * 6,
                "coupling": [Coupling(joint=7, by=1, pulses_per_degree=1.0)],
            },
            "coupling of joint 7 by 1",
        ),
    ],
)
def test_factors_that_do_not_fit_the_model_are_refused(settings, problem):
    with pytest.raises(GatewaySettingsError, match=problem):
        axes(**settings)


def test_an_axis_that_the_controller_does_not_send_is_named():
    arm = axes(pulses_per_degree=(1.0,) * 6, axes=(1, 2, 3, 4, 5, 8))
    with pytest.raises(ValueError, match="axis 8 is declared, the controller sends 7"):
        arm.positions((0,) * 7)


def test_control_groups_have_the_manuals_numbers():
    assert [instance_of(each) for each in ("R1", "R8", "B1", "B8", "S1", "S24")] == [1, 8, 11, 18, 21, 44]
    for wrong in ("R0", "R9", "S25", "X1", "1", ""):
        with pytest.raises(GatewaySettingsError, match="R1 to R8"):
            instance_of(wrong)


# --------------------------------------------------------------------------- polling

POSITION = Read(Command.POSITION, 1)


def answer_to(asked, added_status=0):
    return Answer(asked.number, asked.read.service, 0x1F if added_status else 0, added_status, b"")


def polled(polling, seconds, *, answer_s=0.002, added_status=0, begin_s=0.0):
    """Return the questions asked in this time, each answered after a while."""
    now_s, found = begin_s, []
    while now_s < begin_s + seconds:
        asked = polling.next_question(now_s)
        if asked is None:
            now_s = polling.wake_s()
            continue
        found.append(asked)
        assert polling.next_question(now_s + 0.001) is None or polling.asked is asked
        now_s += answer_s
        assert polling.take(answer_to(asked, added_status), now_s) is asked
    return found


def both():
    return Polling([Regular(POSITION, 0.05), Regular(STATUS, 0.2)], ())


def test_each_question_has_its_rate_and_one_is_open_at_a_time():
    found = polled(both(), 10.0)
    assert sum(each.read is POSITION for each in found) == pytest.approx(200, abs=3)
    assert sum(each.read is STATUS for each in found) == pytest.approx(50, abs=3)
    # A slow controller answers both, each more seldom.
    slow = polled(both(), 10.0, answer_s=0.1)
    assert len(slow) == pytest.approx(100, abs=2)
    assert sum(each.read is STATUS for each in slow) > 15


def test_a_busy_controller_is_asked_half_as_often_and_later_again_as_before():
    polling = both()
    asked = polling.next_question(0.0)
    polling.take(answer_to(asked, 0xD8F1), 0.002)
    assert len(polled(polling, 8.0, begin_s=0.01)) == pytest.approx(100, abs=5)
    assert len(polled(polling, 4.0, begin_s=20.0)) == pytest.approx(100, abs=5)
    # It is never left alone.
    polled(polling, 60.0, added_status=0xFFF6, begin_s=30.0)
    assert polling.slowness == 16
    assert len(polled(polling, 8.0, begin_s=90.0)) >= 8


def test_a_lost_answer_is_given_up_and_a_late_one_is_not_used():
    polling = both()
    first = polling.next_question(0.0)
    assert polling.next_question(TIMEOUT_S / 2) is first or polling.asked is first
    second = polling.next_question(TIMEOUT_S + 0.001)
    assert second.number == first.number + 1
    assert polling.lost == 1
    assert polling.take(answer_to(first), 0.4) is None
    assert polling.take(Answer(second.number, Service.SINGLE, 0, 0, b""), 0.4) is None
    assert polling.take(answer_to(second), 0.4) is second
    assert polling.take(answer_to(second), 0.41) is None


def test_numbers_of_questions_begin_again_after_255():
    numbers = [each.number for each in polled(both(), 12.0)]
    assert numbers[254:258] == [254, 255, 0, 1]
