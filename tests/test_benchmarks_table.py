"""The tables of `benchmarks/run_all.py`, made from results that its programs printed."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from benchmarks import run_all
from benchmarks.harness import program
from tests.site import alive, wait_until

# From real runs, shortened.
GATEWAY = {
    "cores": 2,
    "robots": [
        {
            "robots": 100,
            "sent": 20000,
            "lost": 0,
            "unit": {"n": 20000, "p50": 0.68, "p99": 4.8, "min": 0.2, "max": 11.0},
            "cpu_us": 57.0,
            "bare": {"n": 20000, "p50": 0.3, "p99": 2.4, "min": 0.1, "max": 6.0},
            "bare_cpu_us": 9.5,
        }
    ],
}
RENDERER = {
    "programs": {"ours": "robomesh", "ours, full": "robomesh", "vtk": "vtk 9.7.2"},
    "missing": {"mujoco": "AttributeError: module 'OpenGL.EGL' has no attribute 'EGLDeviceEXT'"},
    "rows": [
        {
            "size": [1280, 720],
            "samples": samples,
            "count": count,
            "views": 1,
            "ours": {"cpu_ms": 45.0, "ms": 50.0},
            "vtk": {"cpu_ms": 60.0, "ms": 70.0},
            "ours, whole": {"cpu_ms": 90.0, "ms": 95.0},
        }
        for samples, count in ((4, "100k"), (0, "20k"))
    ],
}


def recorded(rows: list[str], runs: list[dict[str, Any]], *, growth: bool = False) -> dict[str, Any]:
    return {
        "growth": growth,
        "rows": rows,
        "machine": "2 cores, a machine",
        "begun": "2026-11-26 17:00 UTC",
        "load_before": (0.1, 0.2, 0.3),
        "load_after": (2.0, 1.0, 1.0),
        "took_s": 90.0,
        "interrupted": False,
        "runs": runs,
    }


def run(program: str, number: int, result: Any = None, **more: Any) -> dict[str, Any]:
    outcome = {} if result is None else {"result": result}
    return {"program": program, "round": number, "arguments": [], **outcome, **more}


def gateway(cpu_us: float, bare_us: float) -> dict[str, Any]:
    return {"robots": [GATEWAY["robots"][0] | {"cpu_us": cpu_us, "bare_cpu_us": bare_us}]}  # type: ignore[index]


def cells(text: str, work: str) -> list[str]:
    (line,) = [line for line in text.splitlines() if line.startswith(f"| {work}")]
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_values_are_medians_and_ratios_are_of_the_same_round() -> None:
    rounds = [(50.0, 10.0), (60.0, 10.0), (90.0, 30.0)]
    result = recorded(["gateway"], [run("gateway", at, gateway(*both)) for at, both in enumerate(rounds)])

    cpu, delay = run_all.table(result)

    assert cpu["today"] == {"median": 60.0, "least": 50.0, "most": 90.0, "n": 3}
    # Of the rounds: 5, 6 and 3; that of the medians would be 6.
    assert cpu["ratios"]["bare put"] == {"median": 5.0, "least": 3.0, "most": 6.0, "n": 3}
    assert delay["ratios"]["bare put"]["median"] == pytest.approx(2.0)
    assert cells(run_all.markdown(result), "gateway, 100 robots")[1:] == [
        "60.0 (50.0 to 90.0) us",
        "bare put 10.0 (10.0 to 30.0)",
        "bare put 5.00 (3.00 to 6.00)",
        "at most 40 us",
    ]


def test_missing_peer_and_failed_program_are_named_in_the_table() -> None:
    result = recorded(
        ["render", "gateway"],
        [run("renderer", 0, RENDERER), run("gateway", 0, failed="ended after 60 s: no | answer")],
    )

    text = run_all.markdown(result)

    peers = "vtk 60.0; ours with every triangle 90.0; not measured: mujoco, pyrender"
    assert cells(text, "render 720p with 4x")[2] == peers
    assert "EGLDeviceEXT" in text
    assert "not measured (gateway: ended after 60 s: no \\| answer)" in text


def test_growth_has_the_slope_of_the_logarithms() -> None:
    costs = {1: 20.0, 10: 200.0, 100: 20_000.0}
    runs = [
        run("streams", count, {"rates": [{"cores": cost / 1e3, "rates": [1.0] * count}]})
        | {"arguments": [*run_all.GROWTH[-1].run(count).arguments]}
        for count, cost in costs.items()
    ]

    (line,) = run_all.growth_table(recorded(["views"], runs, growth=True))

    assert line["costs"] == pytest.approx({"1": 20.0, "10": 200.0, "100": 20_000.0})
    assert (line["exponent"], line["last_exponent"]) == (pytest.approx(1.5), pytest.approx(2.0))


def test_every_row_has_lines_and_its_programs_exist() -> None:
    assert {line.row for line in run_all.LINES} == {*run_all.ROWS}
    programs = {each.program for runs in run_all.ROWS.values() for each in runs}
    programs |= {growth.run(1).program for growth in run_all.GROWTH}
    assert programs <= {*program.programs()}


def test_the_plan_of_all_rows_takes_less_than_twenty_minutes() -> None:
    assert sum(each.seconds for _, each in run_all.rounds([*run_all.ROWS])) < 20 * 60


@pytest.mark.slow
def test_end_of_a_program_ends_all_that_it_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told, program = tmp_path / "child", tmp_path / "hanging.py"
    program.write_text(
        "import os, signal, subprocess, sys, time\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "started = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
        f"open({str(told)!r} + '.new', 'w').write(str(started.pid))\n"
        f"os.rename({str(told)!r} + '.new', {str(told)!r})\n"
        "time.sleep(600)\n"
    )
    monkeypatch.setattr(run_all, "ENDS_WITHIN_S", 0.2)
    process = subprocess.Popen([sys.executable, str(program)], start_new_session=True)
    try:
        wait_until(told.exists)
    finally:
        run_all.end(process)

    assert process.returncode is not None
    wait_until(lambda: not alive(int(told.read_text())))
