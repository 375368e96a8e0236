"""`./dev test --long`: which parts run, in which order, and what is said where one cannot."""

import contextlib
import json
import subprocess

import psutil
import pytest

from tests.long import parts
from tests.long.parts import Part
from tests.site import wait_until

pytestmark = pytest.mark.slow

OF_PYTEST = """SKIPPED [2] tests/test_a.py:3: no curl
SKIPPED [1] tests/test_b.py: no curl
=== 1 passed, 3 skipped in 0.1s ===
"""


def here(*runs, set_up="echo Python 3.11.2"):
    return Part(runs, set_up=set_up)


@pytest.fixture
def long(tmp_path, monkeypatch, capsys):
    """Return a function that runs parts; it returns the exit's argument, the table's lines, and results."""
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    words = ("-c", "user.name=wang", "-c", "user.email=", "commit", "-q", "--allow-empty", "-m", "First")
    subprocess.run(["git", "-C", tmp_path, *words], check=True)
    monkeypatch.setattr(parts, "ROOT", tmp_path)
    monkeypatch.setattr(parts, "RESULTS", tmp_path / ".long")

    def run(names=(), **there):
        monkeypatch.setattr(parts, "PARTS", there)
        with pytest.raises(SystemExit) as ended:
            parts.main([*names])
        table = [line.split(maxsplit=2)[:2] for line in capsys.readouterr().out.splitlines()]
        files = (tmp_path / ".long").glob("*.json")
        return ended.value.code, table, {each.stem: json.loads(each.read_text()) for each in files}

    return run


def test_an_unknown_part_is_refused_before_any_runs(long):
    code, table, results = long(["one", "two"], one=here("true"))
    assert code == "dev: there is no part 'two': one are there"
    assert (table, results) == ([], {})


def test_every_part_runs_and_its_result_keeps_counts_and_skips_by_reason(long, tmp_path):
    (tmp_path / "printed").write_text(OF_PYTEST)
    code, table, results = long(one=here("cat ../../../printed"), two=here("echo long: seed 7"))
    assert (code, table) == (False, [["one", "passed"], ["two", "passed"]])
    assert (results["one"]["counts"], results["one"]["skips"]) == (["1 passed, 3 skipped"], {"no curl": 3})
    assert (results["two"]["counts"], results["two"]["python"]) == (["seed 7"], "3.11.2")


def test_only_named_parts_run_and_the_table_keeps_earlier_results(long):
    there = {"one": here("true"), "two": here("true"), "three": here("true")}
    long(["three"], **there)
    assert long(["one"], **there)[:2] == (False, [["one", "passed"], ["three", "passed"]])


def test_all_commands_of_a_part_run_and_each_that_fails_is_named(long):
    code, table, results = long(one=here("exit 3", "false", "echo long: last"))
    assert (code, table) == (True, [["one", "failed"]])
    assert results["one"]["counts"] == ["failed: exit 3", "failed: false", "last"]


def test_parts_that_cannot_run_stop_no_other_and_the_reason_is_said_last(long, monkeypatch):
    monkeypatch.setattr(parts.os, "geteuid", lambda: 0)
    monkeypatch.setattr(parts.shutil, "which", lambda name: None)
    no_network = (
        "printf 'error: No package\\n  cause: No route\\ndev: uv failed; see above\\n' && false && echo ready"
    )
    code, table, _ = long(
        one=Part(("true",), debian="bookworm"), two=here("true"), three=here("true", set_up=no_network)
    )
    assert table == [["one", "not"], ["two", "passed"], ["three", "not"]]
    assert code.splitlines() == [
        "dev: one not run: mmdebstrap is not installed: apt-get install mmdebstrap",
        "dev: three not run: error: No package; cause: No route",
    ]


def test_what_a_part_started_ends_with_it(long, tmp_path):
    code, _, _ = long(one=here("sleep 1000 & echo $! > ../../pid"))
    assert not code
    number = int((tmp_path / ".long" / "pid").read_text())
    with contextlib.suppress(psutil.NoSuchProcess):
        wait_until(lambda: psutil.Process(number).status() == psutil.STATUS_ZOMBIE)
