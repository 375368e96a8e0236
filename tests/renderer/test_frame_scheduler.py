"""Choice of the next view and of anti-aliasing on a slow machine, with a simulated clock."""

from dataclasses import dataclass

import pytest

from renderer.service.frame_scheduler import FrameScheduler, due_with_placements, next_due, next_view


@dataclass
class View:
    """A view that changes constantly."""

    fps: float
    due_at: float = 0.0
    drawn: int = 0


def drawn(views, *, takes_s, seconds):
    """Draw for `seconds`, each picture taking `takes_s`; return the rate of each view."""
    now = 0.0
    while now < seconds:
        view, soonest = next_view(views, now)
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


def test_on_a_slow_machine_all_rates_fall_evenly():
    rates = drawn([View(30.0) for _ in range(4)], takes_s=0.05, seconds=20.0)
    assert rates == pytest.approx([5.0] * 4, rel=0.02)


def test_a_slow_view_keeps_its_rate_while_fast_ones_cannot():
    *fast, slow = drawn([View(30.0), View(30.0), View(2.0)], takes_s=0.05, seconds=20.0)
    assert slow == pytest.approx(2.0, rel=0.05)
    assert fast == pytest.approx([9.0, 9.0], rel=0.05)


def test_missed_pictures_are_not_made_up_for():
    view = View(30.0)
    drawn([view], takes_s=0.001, seconds=1.0)
    view.drawn = 0
    now = 10.0  # after nine seconds without a picture
    while now < 11.0:
        due, soonest = next_view([view], now)
        if due is not None:
            view.due_at = next_due(view.due_at, now, 1.0 / view.fps)
            view.drawn += 1
        now = max(soonest, now + 0.001)
    assert view.drawn <= 31


def test_without_views_nothing_is_due():
    assert next_view([], 1.0) == (None, float("inf"))


def run(scheduler, *, takes_s, wanted_hz, seconds, now=0.0):
    """Draw as fast as possible; return the changes (time, coarse, slow), and the end time."""
    changes = []
    end = now + seconds
    while now < end:
        took = takes_s(scheduler.coarse)
        now += max(took, 1.0 / wanted_hz)
        before = scheduler.coarse, scheduler.slow
        scheduler.record(now, took, wanted_hz=wanted_hz)
        if (scheduler.coarse, scheduler.slow) != before:
            changes.append((round(now), scheduler.coarse, scheduler.slow))
    return changes, now


def test_anti_aliasing_is_turned_off_on_a_slow_machine_and_stays_off():
    scheduler = FrameScheduler()
    changes, _ = run(
        scheduler, takes_s=lambda coarse: 0.025 if coarse else 0.05, wanted_hz=30.0, seconds=60.0
    )
    assert changes == [(2, True, False)]


def test_anti_aliasing_is_turned_on_again_when_there_is_time():
    scheduler = FrameScheduler()
    _, now = run(scheduler, takes_s=lambda coarse: 0.025 if coarse else 0.05, wanted_hz=30.0, seconds=10.0)
    assert scheduler.coarse
    changes, _ = run(
        scheduler, takes_s=lambda coarse: 0.008 if coarse else 0.016, wanted_hz=30.0, seconds=20.0, now=now
    )
    assert [coarse for _, coarse, _ in changes] == [False]


def test_slow_is_reported_once_and_its_end_once():
    scheduler = FrameScheduler()
    changes, now = run(scheduler, takes_s=lambda coarse: 0.1, wanted_hz=60.0, seconds=60.0)
    assert [slow for _, _, slow in changes] == [False, True]
    assert 5 <= changes[-1][0] <= 8
    assert scheduler.rate_hz(now) == pytest.approx(10.0, rel=0.1)
    changes, _ = run(scheduler, takes_s=lambda coarse: 0.002, wanted_hz=60.0, seconds=30.0, now=now)
    assert [slow for _, _, slow in changes if not slow][-1:] == [False]
    assert not scheduler.slow


def test_a_short_overload_changes_nothing():
    scheduler = FrameScheduler()
    changes, now = run(scheduler, takes_s=lambda coarse: 0.1, wanted_hz=30.0, seconds=1.0)
    changes += run(scheduler, takes_s=lambda coarse: 0.01, wanted_hz=30.0, seconds=20.0, now=now)[0]
    assert changes == []


def test_reset_clears_the_measurements():
    scheduler = FrameScheduler()
    run(scheduler, takes_s=lambda coarse: 0.1, wanted_hz=60.0, seconds=20.0)
    assert (scheduler.coarse, scheduler.slow) == (True, True)
    scheduler.reset()
    assert (scheduler.coarse, scheduler.slow, scheduler.rate_hz(20.0)) == (False, False, 0.0)


@pytest.mark.parametrize("fps", [30.0, 60.0])
def test_a_picture_of_a_moving_robot_shows_placements_that_have_just_arrived(fps):
    arrivals = [(i + 0.2 * ((7 * i) % 10) / 10) / 60.0 for i in range(600)]
    due_at, ages = 0.0, []
    for i, moved_at in enumerate(arrivals[:-1]):
        # At the arrival, or after it if no other arrives before.
        now = max(moved_at, due_with_placements(due_at, moved_at))
        if now < arrivals[i + 1]:
            due_at = next_due(due_at, now, 1.0 / fps)
            ages.append(now - moved_at)
    assert len(ages) == pytest.approx(fps * 10.0, rel=0.02)
    assert sum(ages) / len(ages) < 0.001


def test_a_view_keeps_its_rate_without_new_placements():
    view = View(30.0)
    view.due_at, now, drawn_at = 0.0, 0.0, []
    while now < 2.0:
        now = due_with_placements(view.due_at, moved_at=-1.0)
        view.due_at = next_due(view.due_at, now, 1.0 / view.fps)
        drawn_at.append(now)
    assert len(drawn_at) == pytest.approx(60, abs=2)
