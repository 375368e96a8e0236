"""Health of a link, with the clock as an argument."""

import pytest

from protocol_gateway.link.health import Arrivals, LossCounter, ResponseTimer
from protocol_gateway.seam import Activity, JointsReceived, Refused, StatusReceived

IDLE, MOVING = StatusReceived(activity=Activity.IDLE), StatusReceived(activity=Activity.MOVING)


def arrivals(*spans_s):
    times, now_s = Arrivals(), 100.0
    for span_s in spans_s:
        now_s += span_s
        times.count(1, now_s)
    return times, now_s


def test_units_in_step_have_no_jitter_and_a_rate():
    times, now_s = arrivals(*[0.01] * 300)
    assert times.jitter_s(now_s) == pytest.approx(0.0, abs=1e-9)
    assert times.rate_hz(now_s) == pytest.approx(100.0, rel=0.02)


def test_jitter_is_the_99th_percentile_less_the_median():
    times, now_s = arrivals(*([0.01] * 49 + [0.03]) * 8)
    assert times.jitter_s(now_s) == pytest.approx(0.02)


def test_few_or_old_units_give_no_jitter_and_rate():
    times, now_s = arrivals(*[0.01] * 15)
    assert times.jitter_s(now_s) is None
    times, now_s = arrivals(*[0.01] * 200)
    assert times.jitter_s(now_s + 6.0) is None
    assert times.rate_hz(now_s + 2.5) == 0.0


def losses(*times_s):
    losses = LossCounter()
    for time_s in times_s:
        losses.add(time_s)
    return losses.lost


REGULAR = [number * 0.01 for number in range(100)]


@pytest.mark.parametrize(
    ("times_s", "lost"),
    [
        (REGULAR, 0),
        ([time_s for number, time_s in enumerate(REGULAR) if number not in (30, 31, 55)], 3),
        ([each for time_s in REGULAR for each in (time_s, time_s)], 0),  # joints and status of one unit
        ([time_s + 0.004 * (number % 7 == 0) for number, time_s in enumerate(REGULAR)], 0),  # delayed
        ([*REGULAR, *[5000.0 + time_s for time_s in REGULAR]], 0),  # the clock was set
        ([*REGULAR, *REGULAR], 0),  # it was restarted
        ([0.014 * number - 0.014 * number % 0.01 for number in range(100)], 0),  # a coarse clock
        ([number**1.5 for number in range(60)], 0),  # no rate at all
    ],
)
def test_lost_units_are_gaps_in_a_regular_clock(times_s, lost):
    assert losses(*times_s) == lost


def test_an_answer_is_a_refusal_or_a_status_that_changes_after_a_command():
    timer = ResponseTimer()
    timer.event_received(IDLE, 1.0)
    timer.event_received(MOVING, 1.1)
    assert timer.answer_s is None  # no command was sent
    timer.command_sent(2.0)
    timer.event_received(JointsReceived((0.0,)), 2.01)
    timer.event_received(MOVING, 2.02)
    assert timer.answer_s is None
    timer.event_received(IDLE, 2.03)
    assert timer.answer_s == pytest.approx(0.03)
    timer.event_received(MOVING, 2.5)
    assert timer.answer_s == pytest.approx(0.03)
    timer.command_sent(3.0)
    timer.event_received(Refused(5, "limit"), 3.2)
    assert timer.answer_s == pytest.approx(0.2)


def test_a_response_after_two_seconds_is_no_answer():
    timer = ResponseTimer()
    timer.event_received(IDLE, 0.0)
    timer.command_sent(1.0)
    timer.event_received(MOVING, 3.5)
    assert timer.answer_s is None
