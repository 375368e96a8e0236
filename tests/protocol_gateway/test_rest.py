"""Tests of the proof of rest after a stop."""

import pytest

from protocol_gateway.driver_parts.rest import STILL_S, Rest
from protocol_gateway.seam import Activity

HERE, MOVED = (0.0, 1.0), (0.0, 1.01)


def still_arm():
    rest = Rest([1e-3, 1e-3])
    rest.at(HERE, 0.0)
    return rest


def test_without_a_stop_everything_is_reported_as_the_controller_says_it():
    for activity in (None, *Activity):
        assert still_arm().reported(activity, 0.0) is activity


def test_an_arm_that_a_stop_found_moving_is_idle_only_after_it_was_still_since_then():
    rest = still_arm()
    rest.prove_again()
    assert rest.reported(Activity.IDLE, 10.0) is Activity.MOVING  # where it is since the stop is unknown
    rest.at(HERE, 10.0)
    rest.at(MOVED, 10.3)
    assert rest.reported(Activity.IDLE, 10.3 + STILL_S - 0.01) is Activity.MOVING
    assert rest.reported(Activity.IDLE, 10.3 + STILL_S) is Activity.IDLE
    assert rest.reported(Activity.IDLE, 10.3) is Activity.IDLE


def test_an_arm_that_a_stop_found_still_is_idle_at_once():
    rest = still_arm()
    rest.prove_again(moved=False)
    assert rest.reported(Activity.IDLE, STILL_S) is Activity.IDLE


def test_a_lost_connection_proves_nothing():
    rest = still_arm()
    rest.prove_again(moved=False)
    rest.forget()
    assert rest.reported(Activity.IDLE, 10.0) is Activity.MOVING
    assert not rest.near(HERE)


@pytest.mark.parametrize("unknown", [None, Activity.MOVING])
def test_a_controller_that_moves_or_does_not_say_proves_no_rest(unknown):
    rest = still_arm()
    rest.prove_again(moved=False)
    assert rest.reported(unknown, 10.0) is unknown
    rest.at(MOVED, 10.0)
    assert rest.reported(Activity.IDLE, 10.1) is Activity.MOVING


def test_a_fault_is_shown_at_once_unless_the_controller_may_say_it_of_an_arm_that_moves():
    for at_rest, shown in (((Activity.IDLE,), Activity.FAULT), (tuple(Activity), Activity.MOVING)):
        rest = Rest([1e-3], at_rest)
        rest.prove_again()
        assert rest.reported(Activity.FAULT, 1.0) is shown


def test_an_open_motion_is_not_idle():
    assert still_arm().reported(Activity.IDLE, 10.0, runs=True) is Activity.MOVING
    assert still_arm().reported(Activity.HOLDING, 10.0, runs=True) is Activity.HOLDING
