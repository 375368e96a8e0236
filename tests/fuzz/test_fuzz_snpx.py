"""A short run of the fuzzer of SNPX; run the program for a long one."""

from collections import Counter

import pytest

from protocol_gateway.drivers.fanuc import data as values
from protocol_gateway.drivers.fanuc.assignments import Block
from protocol_gateway.drivers.fanuc.data import Position
from tests.fuzz import fuzz_snpx as fuzzer


@pytest.mark.slow
def test_changed_answers_give_nothing_but_what_a_strict_reading_gives() -> None:
    counts: Counter[str] = Counter()
    done, finding = fuzzer.fuzz(20_000, 3, counts)
    assert finding is None, finding
    assert done == 20_000
    assert min(counts[each] for each in ("JointsReceived", "MalformedReceived", "SignalsReceived")) > 500
    assert min(counts[each] for each in ("AlarmReceived", "StatusReceived")) > 50


def test_position_that_is_read_carelessly_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def careless(data: bytes) -> Position:
        return Position(None, values.POSITION.unpack(data)[17:26])

    monkeypatch.setattr(values, "position", careless)
    _, finding = fuzzer.fuzz(3000, 1, Counter())
    assert finding is not None
    assert "a strict reading gives" in finding.problem


def test_words_of_another_client_that_are_used_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def careless(block: Block, data: bytes) -> dict[object, bytes]:
        begin = block.first_word
        return {
            each.variable: data[2 * (each.first_word - begin) :][: 2 * each.variable.words]
            for each in block.assignments
        }

    monkeypatch.setattr(Block, "values", careless)
    _, finding = fuzzer.fuzz(5000, 1, Counter())
    assert finding is not None


def test_exception_that_escapes_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(data: bytes) -> str:
        raise ZeroDivisionError

    monkeypatch.setattr(values, "text", broken)
    _, finding = fuzzer.fuzz(3000, 1, Counter())
    assert finding is not None
    assert "ZeroDivisionError" in finding.problem
