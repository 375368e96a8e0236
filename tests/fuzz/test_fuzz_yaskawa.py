"""A short run of the fuzzer of HSES; run the program for a long one."""

import struct
from collections import Counter

import pytest

from protocol_gateway.drivers.yaskawa import data as payloads
from protocol_gateway.drivers.yaskawa.data import Position
from tests.fuzz import fuzz_yaskawa as fuzzer


@pytest.mark.slow
def test_changed_answers_give_nothing_but_what_a_strict_reading_gives() -> None:
    counts: Counter[str] = Counter()
    done, finding = fuzzer.fuzz(20_000, 3, counts)
    assert finding is None, finding
    assert done == 20_000
    assert min(counts[each] for each in ("JointsReceived", "MalformedReceived", "SignalsReceived")) > 500
    assert counts["AlarmReceived"] > 50


def test_position_that_is_read_carelessly_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def careless(data: bytes) -> Position:
        return Position(0, 0, 0, 0, 0, struct.unpack_from("<8i", data.ljust(52, b"\0"), 20))

    monkeypatch.setattr(payloads, "position", careless)
    _, finding = fuzzer.fuzz(2000, 1, Counter())
    assert finding is not None
    assert "a strict reading gives" in finding.problem


def test_exception_that_escapes_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(data: bytes) -> str:
        raise ZeroDivisionError

    monkeypatch.setattr(payloads, "text", broken)
    _, finding = fuzzer.fuzz(2000, 1, Counter())
    assert finding is not None
    assert "ZeroDivisionError" in finding.problem
