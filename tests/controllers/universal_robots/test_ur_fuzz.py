"""Short runs of the fuzz programs of Universal Robots, and proof that they find faults."""

import struct

import pytest

from controllers.universal_robots import motion_driver
from controllers.universal_robots.interfaces import primary
from controllers.universal_robots.interfaces.dashboard import Dashboard
from controllers.universal_robots.interfaces.rtde_messages import Recipe
from tests.controllers.universal_robots import fuzz_ur, fuzz_ur_motion
from tests.fuzz.fuzzing import assert_found, assert_strict, broken, no_problem

MOTIONS = {"JointsReceived": 500, "MoveAbsolute": 100, "ended": 100, "Recover": 5}


def careless_state(recipe, payload):
    flat = struct.unpack_from(">7did", payload.ljust(80, b"\0"), 1)
    return {"timestamp": flat[0], "actual_q": flat[1:7], "robot_mode": flat[7], "payload": flat[8]}


@pytest.mark.parametrize(
    ("program", "least"),
    [
        (fuzz_ur, dict.fromkeys(("ControllerState", "Alarm", "Malformed", "Popup"), 100)),
        (fuzz_ur_motion, MOTIONS | {"universal_robots.arm_stopped": 5}),
    ],
)
@pytest.mark.slow
def test_changed_messages_give_nothing_but_what_a_strict_reading_gives(program, least):
    assert_strict(program, least)


@pytest.mark.parametrize(
    ("program", "owner", "attribute", "fault", "problem"),
    [
        (fuzz_ur, Recipe, "read", careless_state, "a strict reading gives"),
        (fuzz_ur, primary, "_text", broken, "ZeroDivisionError"),
        (fuzz_ur_motion, motion_driver, "_problem", no_problem, "a strict reading does for"),
        (fuzz_ur_motion, Dashboard, "_take", broken, "ZeroDivisionError"),
    ],
)
def test_a_fault_of_a_driver_is_found(program, owner, attribute, fault, problem, monkeypatch):
    monkeypatch.setattr(owner, attribute, fault)
    assert_found(program, problem)
