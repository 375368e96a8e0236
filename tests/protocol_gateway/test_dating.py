import pytest

from protocol_gateway.link.dating import Dating, Received


def at(seconds):
    return Received(seconds, round(seconds * 1e9))


def fresh(dating, begin_s=100.0, clock_s=0.0):
    """A second of units at 100 Hz; when it ends."""
    for number in range(101):
        now = at(begin_s + number * 0.01)
        assert dating.date(clock_s + number * 0.01, now) == now
    return begin_s + 1.0


def test_units_that_come_as_they_are_sent_are_dated_when_they_come():
    fresh(Dating())


def test_a_burst_after_a_gap_is_dated_when_it_should_have_come():
    dating = Dating()
    end_s = fresh(dating)
    # Three seconds held back, then everything within a few milliseconds.
    for number in range(1, 280):
        date = dating.date(1.0 + number * 0.01, at(end_s + 3.0))
        assert date.monotonic_s == pytest.approx(end_s + number * 0.01)
        assert date.wall_ns == pytest.approx((end_s + number * 0.01) * 1e9, abs=10)
    now = at(end_s + 3.01)
    assert dating.date(1.0 + 3.01, now) == now


def test_a_controller_that_was_silent_itself_is_fresh_when_it_speaks_again():
    dating = Dating()
    end_s = fresh(dating)
    now = at(end_s + 3.0)
    assert dating.date(1.0 + 3.0, now) == now


@pytest.mark.parametrize("clock_s", [0.2, 1.0, 5000.0])
def test_a_clock_that_was_set_or_is_stuck_makes_nothing_look_old_without_a_gap(clock_s):
    dating = Dating()
    end_s = fresh(dating)
    for number in range(1, 300):
        now = at(end_s + number * 0.01)
        assert dating.date(clock_s, now) == now


def test_after_a_gap_a_slow_clock_is_believed_for_a_second_only():
    dating = Dating()
    end_s = fresh(dating)
    assert dating.date(1.01, at(end_s + 2.0)).monotonic_s == pytest.approx(end_s + 0.01)
    for number in range(1, 200):
        dating.date(1.01 + number * 0.01, at(end_s + 2.0 + number * 0.01))
    now = at(end_s + 4.0)
    assert dating.date(3.01, now) == now


def test_without_a_clock_everything_is_dated_when_it_comes():
    dating = Dating()
    for now in (at(1.0), at(1.01), at(5.0), at(5.0)):
        assert dating.date(None, now) == now
