"""Short runs of the fuzzers of controllers' protocols, and proof that each finds faults.

Run a program, such as `python tests/fuzz/fuzz_yaskawa.py`, for a long one.
"""

import struct
from collections import Counter
from collections.abc import Mapping, Sequence
from types import ModuleType
from typing import Any

import pytest

from controllers.fanuc import data as fanuc_data
from controllers.fanuc import rmi
from controllers.fanuc.assignments import Block
from controllers.fanuc.data import Position as FanucPosition
from controllers.fanuc.rmi import Answer
from controllers.opcua import driver as opcua_driver
from controllers.opcua.joints import Joiner
from controllers.universal_robots import motion_driver as ur_motion
from controllers.universal_robots import primary
from controllers.universal_robots.dashboard import Dashboard
from controllers.universal_robots.rtde_messages import Recipe
from controllers.yaskawa import data as yaskawa_data
from controllers.yaskawa import motion_driver as yaskawa_motion
from controllers.yaskawa.data import Position as YaskawaPosition
from tests.fuzz import (
    fuzz_opcua,
    fuzz_rmi,
    fuzz_snpx,
    fuzz_universal_robots,
    fuzz_ur_motion,
    fuzz_yaskawa,
    fuzz_yaskawa_motion,
)

JOINTS = {"JointsReceived": 500, "MalformedReceived": 500}
# So often, at least, each of these happens in a run.
SEEN: Mapping[ModuleType, Mapping[str, int]] = {
    fuzz_opcua: JOINTS | {"SignalsReceived": 500},
    fuzz_rmi: dict.fromkeys(("MalformedReceived", "motion", "abort", "aborts"), 500),
    fuzz_snpx: JOINTS | {"SignalsReceived": 500, "AlarmReceived": 50, "StatusReceived": 50},
    fuzz_universal_robots: dict.fromkeys(("ControllerState", "Alarm", "Malformed", "Popup"), 100),
    fuzz_ur_motion: {"JointsReceived": 500, "MoveAbsolute": 100, "ended": 100, "Recover": 5}
    | {"universal_robots.arm_stopped": 5},
    fuzz_yaskawa: JOINTS | {"SignalsReceived": 500, "AlarmReceived": 50},
    fuzz_yaskawa_motion: JOINTS
    | {"MoveAbsolute": 50, "arrived": 20, "Refused": 3, "hses.held": 3, "hses.arm_stopped": 3},
}


class CarelessJoiner(Joiner):
    """Joins joints of different moments."""

    def __init__(self, axes: Any, limit_s: float) -> None:
        super().__init__(axes, 1e9)


def careless_answer(line: bytes, read: Any = rmi.read) -> Answer:
    answer = read(line)
    return Answer(answer.name, 0, answer.sequence, answer.port or 1, answer.version)


def careless_fanuc_position(data: bytes) -> FanucPosition:
    return FanucPosition(None, fanuc_data.POSITION.unpack(data)[17:26])


def words_of_another_client(block: Block, data: bytes) -> dict[object, bytes]:
    begin = block.first_word
    return {
        each.variable: data[2 * (each.first_word - begin) :][: 2 * each.variable.words]
        for each in block.assignments
    }


def careless_state(recipe: Recipe, payload: bytes) -> dict[str, object]:
    flat = struct.unpack_from(">7did", payload.ljust(80, b"\0"), 1)
    return {"timestamp": flat[0], "actual_q": flat[1:7], "robot_mode": flat[7], "payload": flat[8]}


def careless_yaskawa_position(data: bytes) -> YaskawaPosition:
    return YaskawaPosition(0, 0, 0, 0, 0, struct.unpack_from("<8i", data.ljust(52, b"\0"), 20))


def no_problem(*given: object) -> None:
    """Find no reason against a motion."""


def broken(*given: object) -> None:
    raise ZeroDivisionError


FAULTS: Sequence[tuple[ModuleType, Any, str, Any, str]] = [
    (fuzz_opcua, opcua_driver, "Joiner", CarelessJoiner, "a strict reading gives"),
    (fuzz_opcua, opcua_driver, "decode", broken, "ZeroDivisionError"),
    (fuzz_rmi, rmi, "read", careless_answer, "a strict reading gives"),
    (fuzz_rmi, rmi, "_integer", broken, "ZeroDivisionError"),
    (fuzz_snpx, fanuc_data, "position", careless_fanuc_position, "a strict reading gives"),
    (fuzz_snpx, Block, "values", words_of_another_client, ""),
    (fuzz_snpx, fanuc_data, "text", broken, "ZeroDivisionError"),
    (fuzz_universal_robots, Recipe, "read", careless_state, "a strict reading gives"),
    (fuzz_universal_robots, primary, "_text", broken, "ZeroDivisionError"),
    (fuzz_ur_motion, ur_motion, "_problem", no_problem, "a strict reading does for"),
    (fuzz_ur_motion, Dashboard, "_take", broken, "ZeroDivisionError"),
    (fuzz_yaskawa, yaskawa_data, "position", careless_yaskawa_position, "a strict reading gives"),
    (fuzz_yaskawa, yaskawa_data, "text", broken, "ZeroDivisionError"),
    (fuzz_yaskawa_motion, yaskawa_motion, "_stopped", no_problem, ""),
    (fuzz_yaskawa_motion, yaskawa_data, "axis_names", broken, "ZeroDivisionError"),
]


def name(value: object) -> str:
    return str(getattr(value, "__name__", value)).rpartition(".")[2]


@pytest.mark.parametrize("program", SEEN, ids=name)
@pytest.mark.slow
def test_changed_messages_give_nothing_but_what_a_strict_reading_gives(program: ModuleType) -> None:
    counts: Counter[str] = Counter()
    done, finding = program.fuzz(20_000, 3, counts)
    assert finding is None, finding
    assert done >= 20_000
    assert not {each: counts[each] for each, least in SEEN[program].items() if counts[each] < least}


@pytest.mark.parametrize(("program", "owner", "attribute", "fault", "problem"), FAULTS, ids=name)
def test_a_fault_of_a_driver_is_found(
    program: ModuleType,
    owner: Any,
    attribute: str,
    fault: Any,
    problem: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(owner, attribute, fault)
    _, finding = program.fuzz(20_000, 2, Counter())
    assert finding is not None
    assert problem in finding.problem
