"""A short run of the fuzzer of Universal Robots' messages; run the program for a long one."""

import struct
from collections import Counter

import pytest

from protocol_gateway.drivers.universal_robots import primary
from protocol_gateway.drivers.universal_robots.rtde_messages import Recipe
from tests.fuzz import fuzz_universal_robots as fuzzer


@pytest.mark.slow
def test_changed_messages_give_no_state_and_no_alarm_but_what_a_strict_reading_gives() -> None:
    counts: Counter[str] = Counter()
    done, finding = fuzzer.fuzz(20_000, 3, counts)
    assert finding is None, finding
    assert done >= 20_000
    assert min(counts[each] for each in ("ControllerState", "Alarm", "Malformed", "Popup")) > 100


def test_state_that_is_read_carelessly_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def careless(recipe: Recipe, payload: bytes) -> dict[str, object]:
        flat = struct.unpack_from(">7did", payload.ljust(80, b"\0"), 1)
        return {"timestamp": flat[0], "actual_q": flat[1:7], "robot_mode": flat[7], "payload": flat[8]}

    monkeypatch.setattr(Recipe, "read", careless)
    _, finding = fuzzer.fuzz(2000, 1, Counter())
    assert "a strict reading gives" in finding.problem


def test_exception_that_escapes_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(data: bytes) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(primary, "_text", broken)
    _, finding = fuzzer.fuzz(2000, 1, Counter())
    assert "ZeroDivisionError" in finding.problem
