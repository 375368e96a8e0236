"""Short runs of the fuzz programs of HSES, and proof that they find faults."""

import struct

import pytest

from controllers.yaskawa import data, motion_driver
from controllers.yaskawa.data import Position
from tests.controllers.yaskawa import fuzz_hses, fuzz_hses_motion
from tests.fuzz.fuzzing import assert_found, assert_strict, broken, no_problem

JOINTS = {"JointsReceived": 500, "MalformedReceived": 500}
MOTIONS = {"MoveAbsolute": 50, "arrived": 20, "Refused": 3, "hses.held": 3, "hses.arm_stopped": 3}


def careless_position(received):
    return Position(0, 0, 0, 0, 0, struct.unpack_from("<8i", received.ljust(52, b"\0"), 20))


@pytest.mark.parametrize(
    ("program", "least"),
    [
        (fuzz_hses, JOINTS | {"SignalsReceived": 500, "AlarmReceived": 50}),
        (fuzz_hses_motion, JOINTS | MOTIONS),
    ],
)
@pytest.mark.slow
def test_changed_messages_give_nothing_but_what_a_strict_reading_gives(program, least):
    assert_strict(program, least)


@pytest.mark.parametrize(
    ("program", "owner", "attribute", "fault", "problem"),
    [
        (fuzz_hses, data, "position", careless_position, "a strict reading gives"),
        (fuzz_hses, data, "text", broken, "ZeroDivisionError"),
        (fuzz_hses_motion, motion_driver, "_stopped", no_problem, ""),
        (fuzz_hses_motion, data, "axis_names", broken, "ZeroDivisionError"),
    ],
)
def test_a_fault_of_a_driver_is_found(program, owner, attribute, fault, problem, monkeypatch):
    monkeypatch.setattr(owner, attribute, fault)
    assert_found(program, problem)
