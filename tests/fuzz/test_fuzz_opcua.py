"""A short run of the fuzzer of OPC UA; run the program for a long one."""

from collections import Counter

import pytest

from protocol_gateway.drivers.opcua import driver
from protocol_gateway.drivers.opcua.facts import Values, decode
from protocol_gateway.drivers.opcua.joints import Joiner
from tests.fuzz import fuzz_opcua as fuzzer


@pytest.mark.slow
def test_changed_lines_give_nothing_but_what_a_strict_reading_gives() -> None:
    counts: Counter[str] = Counter()
    done, finding = fuzzer.fuzz(20_000, 3, counts)
    assert finding is None, finding
    assert done == 20_000
    assert min(counts[each] for each in ("JointsReceived", "MalformedReceived", "SignalsReceived")) > 500


def test_joints_of_different_moments_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    class Careless(Joiner):
        def __init__(self, axes, limit_s):
            super().__init__(axes, 1e9)

    monkeypatch.setattr(driver, "Joiner", Careless)
    _, finding = fuzzer.fuzz(5000, 1, Counter())
    assert finding is not None
    assert "a strict reading gives" in finding.problem


def test_exception_that_escapes_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(line: bytes) -> object:
        fact = decode(line)
        if isinstance(fact, Values) and len(fact.readings) == 3:
            raise ZeroDivisionError
        return fact

    monkeypatch.setattr(driver, "decode", broken)
    _, finding = fuzzer.fuzz(2000, 1, Counter())
    assert finding is not None
    assert "ZeroDivisionError" in finding.problem
