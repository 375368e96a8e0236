"""Who is drawn next, and how well, when there is not time for all: on a clock of the test's own."""

from dataclasses import dataclass

import pytest

from renderer.frame_scheduler import Pace, next_due, next_of


@dataclass
class View:
    """A view that always has something new."""

    fps: float
    due_at: float = 0.0
    drawn: int = 0


def drawn(views, *, takes_s, seconds):
    """Draw for so long, each picture taking so long."""
    now = 0.0
    while now < seconds:
        view, soonest = next_of(views, now)
        if view is None:
            now = soonest
            continue
        view.due_at = next_due(view.due_at, now, 1.0 / view.fps)
        view.drawn += 1
        now += takes_s
    return [view.drawn / seconds for view in views]


def test_each_view_keeps_its_rate_while_there_is_time():
    rates = drawn([View(30.0), View(10.0), View(1.0)], takes_s=0.01, seconds=20.0)
    assert rates == pytest.approx([30.0, 10.0, 1.0], rel=0.02)


def test_without_time_for_all_each_gets_its_turn():
    rates = drawn([View(30.0) for _ in range(4)], takes_s=0.05, seconds=20.0)
    assert rates == pytest.approx([5.0] * 4, rel=0.02)


def test_a_slow_view_keeps_its_rate_beside_fast_ones_that_cannot():
    *fast, slow = drawn([View(30.0), View(30.0), View(2.0)], takes_s=0.05, seconds=20.0)
    assert slow == pytest.approx(2.0, rel=0.05)
    assert fast == pytest.approx([9.0, 9.0], rel=0.05)


def test_a_view_that_was_late_makes_up_for_nothing():
    view = View(30.0)
    drawn([view], takes_s=0.001, seconds=1.0)
    view.drawn = 0
    now = 10.0  # nine seconds of nothing
    while now < 11.0:
        due, soonest = next_of([view], now)
        if due is not None:
            view.due_at = next_due(view.due_at, now, 1.0 / view.fps)
            view.drawn += 1
        now = max(soonest, now + 0.001)
    assert view.drawn <= 31


def test_nothing_to_draw_is_never_due():
    assert next_of([], 1.0) == (None, float("inf"))


def run(pace, *, takes_s, wanted_hz, seconds, now=0.0):
    """Draw as much as goes; when anti-aliasing went or came, and when it was told to be slow or not."""
    changes = []
    end = now + seconds
    while now < end:
        took = takes_s(pace.coarse)
        now += max(took, 1.0 / wanted_hz)
        before = pace.coarse, pace.slow
        pace.drew(now, took, wanted_hz=wanted_hz)
        if (pace.coarse, pace.slow) != before:
            changes.append((round(now), pace.coarse, pace.slow))
    return changes, now


def test_anti_aliasing_goes_when_the_machine_cannot_keep_up_and_stays_away_while_it_could_not():
    pace = Pace()
    changes, _ = run(pace, takes_s=lambda coarse: 0.025 if coarse else 0.05, wanted_hz=30.0, seconds=60.0)
    assert changes == [(2, True, False)]


def test_anti_aliasing_comes_back_when_there_is_time_for_it():
    pace = Pace()
    _, now = run(pace, takes_s=lambda coarse: 0.025 if coarse else 0.05, wanted_hz=30.0, seconds=10.0)
    assert pace.coarse
    changes, _ = run(
        pace, takes_s=lambda coarse: 0.008 if coarse else 0.016, wanted_hz=30.0, seconds=20.0, now=now
    )
    assert [coarse for _, coarse, _ in changes] == [False]


def test_it_is_told_once_that_the_machine_is_too_slow_and_once_that_it_is_not():
    pace = Pace()
    changes, now = run(pace, takes_s=lambda coarse: 0.1, wanted_hz=60.0, seconds=60.0)
    assert [slow for _, _, slow in changes] == [False, True]
    assert 5 <= changes[-1][0] <= 8
    assert pace.rate_hz(now) == pytest.approx(10.0, rel=0.1)
    changes, _ = run(pace, takes_s=lambda coarse: 0.002, wanted_hz=60.0, seconds=30.0, now=now)
    assert [slow for _, _, slow in changes if not slow][-1:] == [False]
    assert not pace.slow


def test_a_short_rush_changes_nothing():
    pace = Pace()
    changes, now = run(pace, takes_s=lambda coarse: 0.1, wanted_hz=30.0, seconds=1.0)
    changes += run(pace, takes_s=lambda coarse: 0.01, wanted_hz=30.0, seconds=20.0, now=now)[0]
    assert changes == []


def test_when_nobody_watches_all_begins_anew():
    pace = Pace()
    run(pace, takes_s=lambda coarse: 0.1, wanted_hz=60.0, seconds=20.0)
    assert (pace.coarse, pace.slow) == (True, True)
    pace.rested()
    assert (pace.coarse, pace.slow, pace.rate_hz(20.0)) == (False, False, 0.0)
