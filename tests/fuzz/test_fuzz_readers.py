"""A short run of the fuzzer; run `python tests/fuzz/fuzz_readers.py` for a long one."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

INPUTS = {"3ds": 3000, "wrl": 1000, "toml": 500, "glb": 300, "stl": 300, "obj": 200, "ply": 300, "dxf": 100}


@pytest.fixture(scope="module")
def fuzzer() -> ModuleType:
    path = Path(__file__).with_name("fuzz_readers.py")
    spec = importlib.util.spec_from_file_location("fuzz_readers", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclasses look there
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("reader", sorted(INPUTS))
@pytest.mark.slow
def test_changed_files_give_documented_errors_only(fuzzer: ModuleType, reader: str) -> None:
    done, finding = fuzzer.fuzz(reader, INPUTS[reader], 600.0, seed=3)
    assert finding is None, f"{finding.problem}\n{finding.data[:500]!r}"
    # Machines differ; but a run that stops early has shown nothing.
    assert done > 0.9 * INPUTS[reader]


def test_fault_of_a_reader_is_found(fuzzer: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    def read(path: Path) -> None:
        raise ZeroDivisionError(path.name)

    broken = fuzzer.Reader(read, lambda: iter([b"abc"]))
    monkeypatch.setitem(fuzzer.READERS, "3ds", broken)
    done, finding = fuzzer.fuzz("3ds", 10, 5.0, seed=1)
    assert done == 0
    assert "ZeroDivisionError" in finding.problem
