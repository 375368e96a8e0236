"""A short run of the fuzzer; run `python -m tests.fuzz.fuzz_readers` for a long one."""

from pathlib import Path

import pytest

from tests.fuzz import fuzz_readers as fuzzer

INPUTS = {"3ds": 200, "wrl": 200, "toml": 150, "glb": 100, "stl": 100, "obj": 60, "ply": 100, "dxf": 30}


@pytest.mark.parametrize("reader", sorted(INPUTS))
@pytest.mark.slow
def test_changed_files_give_documented_errors_only(reader: str) -> None:
    done, finding = fuzzer.fuzz(reader, INPUTS[reader], 600.0, seed=3)
    assert finding is None, f"{finding.problem}\n{finding.data[:500]!r}"
    # Machines differ; but a run that stops early has shown nothing.
    assert done > 0.9 * INPUTS[reader]


def test_fault_of_a_reader_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def read(path: Path) -> None:
        raise ZeroDivisionError(path.name)

    broken = fuzzer.Reader(read, lambda: iter([b"abc"]))
    monkeypatch.setitem(fuzzer.READERS, "3ds", broken)
    done, finding = fuzzer.fuzz("3ds", 10, 5.0, seed=1)
    assert done == 0
    assert "ZeroDivisionError" in finding.problem
