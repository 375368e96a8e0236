"""A short run of the fuzzer of FANUC's files by FTP; run the program for a long one."""

import re
from collections import Counter

import pytest

from controllers.fanuc import files, ftp
from controllers.fanuc.ftp_driver import FtpDriver
from tests.fuzz import fuzz_fanuc_ftp as fuzzer


@pytest.mark.slow
def test_changed_files_give_nothing_but_what_a_strict_reading_gives() -> None:
    counts: Counter[str] = Counter()
    done, finding = fuzzer.fuzz(20_000, 3, counts)
    assert finding is None, finding
    assert done == 20_000
    assert min(counts[each] for each in ("JointsReceived", "MalformedReceived", "SignalsReceived")) > 300
    assert min(counts[each] for each in ("AlarmReceived", "StatusReceived")) > 50


def test_position_that_is_read_carelessly_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """A number that has lost its point."""
    careless = re.compile(r"(Joint|EXTAXS:) +(\d{1,2}): *-?(\d*\.?\d*|\*+) *")
    monkeypatch.setattr(files, "_JOINT", careless)
    _, finding = fuzzer.fuzz(5000, 1, Counter())
    assert finding is not None
    assert "a strict reading gives" in finding.problem or "could not convert" in finding.problem


def test_file_that_is_used_without_its_confirmation_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    begin = FtpDriver._begin_file

    def careless(self: FtpDriver, now_s: float) -> None:
        begin(self, now_s)
        self._whole = True

    monkeypatch.setattr(FtpDriver, "_begin_file", careless)
    _, finding = fuzzer.fuzz(5000, 1, Counter())
    assert finding is not None
    assert "before the answer to b'RETR" in finding.problem or "whole file" in finding.problem


def test_command_that_is_not_declared_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ftp, "PASSIVE", b"DELE MAIN.TP\r\n")
    _, finding = fuzzer.fuzz(3000, 1, Counter())
    assert finding is not None
    assert "sends b'DELE" in finding.problem
