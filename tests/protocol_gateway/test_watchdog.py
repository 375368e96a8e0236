"""Watchdog of repeating values."""

import pytest

from protocol_gateway.telemetry.watchdog import SLOW_STALE_S, Watchdog


def seen(*reports):
    watchdog = Watchdog()
    for activity, time_s in reports:
        watchdog.reset(activity, time_s)
    return watchdog


@pytest.mark.parametrize(
    ("reports", "ceased"),
    [
        ([], False),
        ([("idle", t) for t in range(4)], True),
        ([("idle", t) for t in range(3)], False),
        ([("idle", t * 3.0) for t in range(9)], False),
        ([("idle" if t % 2 else "moving", t) for t in range(9)], False),
        ([("idle", 0), ("idle", 1), ("moving", 2), ("idle", 3), ("idle", 4)], False),
        ([*(("idle", t) for t in range(4)), ("moving", 5), ("fault", 6)], True),
    ],
)
def test_only_a_repeating_value_can_expire(reports, ceased):
    assert seen(*reports).expired(1000.0) is ceased


def test_it_expires_after_three_seconds_and_recovers_immediately():
    watchdog = seen(*(("idle", t) for t in range(4)))
    assert not watchdog.expired(5.9)
    assert watchdog.expired(6.0)
    watchdog.reset("idle", 6.1)
    assert not watchdog.expired(6.2)


def test_status_that_is_read_slowly_has_longer():
    watchdog = Watchdog(SLOW_STALE_S)
    for time_s in (0, 2, 5, 9, 13):
        watchdog.reset("idle", time_s)
    assert not watchdog.expired(18.9)
    assert watchdog.expired(19.0)
