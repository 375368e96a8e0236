"""A short run of the fuzzer of RMI; run the program for a long one."""

from collections import Counter
from typing import Any

import pytest

from protocol_gateway.drivers.fanuc import rmi
from protocol_gateway.drivers.fanuc.rmi import Answer
from tests.fuzz import fuzz_rmi as fuzzer


@pytest.mark.slow
def test_changed_answers_give_nothing_but_what_a_strict_reading_gives() -> None:
    counts: Counter[str] = Counter()
    done, finding = fuzzer.fuzz(20_000, 3, counts)
    assert finding is None, finding
    assert done == 20_000
    assert min(counts[each] for each in ("MalformedReceived", "motion", "abort", "aborts")) > 500


def test_an_error_that_is_read_carelessly_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    read = rmi.read

    def careless(line: bytes) -> Answer:
        answer = read(line)
        return Answer(answer.name, 0, answer.sequence, answer.port or 1, answer.version)

    monkeypatch.setattr(rmi, "read", careless)
    _, finding = fuzzer.fuzz(3000, 1, Counter())
    assert finding is not None
    assert "a strict reading gives" in finding.problem


def test_exception_that_escapes_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*given: Any) -> int:
        raise ZeroDivisionError

    monkeypatch.setattr(rmi, "_integer", broken)
    _, finding = fuzzer.fuzz(3000, 1, Counter())
    assert finding is not None
    assert "ZeroDivisionError" in finding.problem
