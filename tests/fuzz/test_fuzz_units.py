"""A short run of the fuzzer of units; run `python -m tests.fuzz.fuzz_units` for a long one."""

import pytest

from protocol_gateway.unit_protocol import stream
from protocol_gateway.unit_protocol.records import AbsolutePositions
from tests.fuzz import fuzz_units as fuzzer


@pytest.mark.slow
def test_changed_units_move_nothing_but_what_a_strict_reading_gives() -> None:
    done, finding = fuzzer.fuzz(8_000, seed=3)
    assert finding is None, finding
    assert done == 8_000


def test_unit_that_is_read_carelessly_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def careless(data: bytes, readers: object) -> tuple[AbsolutePositions] | None:
        return (AbsolutePositions((1.0, 2.0, 3.0, 4.0, 5.0)),) if b"ABSOLUTE.DEG*1" in data else None

    monkeypatch.setattr(stream, "read_plain", careless)
    done, finding = fuzzer.fuzz(1000, seed=1)
    assert done < 1000
    assert "a strict reading gives" in finding.problem


def test_exception_that_escapes_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(data: bytes, readers: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(stream, "read_plain", broken)
    done, finding = fuzzer.fuzz(10, seed=1)
    assert done == 0
    assert "ZeroDivisionError" in finding.problem
