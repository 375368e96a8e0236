"""Examples as whole programs, run as a user runs them."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from robomesh.schemas import robomesh_pb2 as schema
from tests.recordings import Written, joints
from tests.site import running_site

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    with running_site(tmp_path_factory.mktemp("site"), services=()) as running:
        yield running


def test_joints_prints_joints_and_ends_quietly_with_its_reader(site):
    program = subprocess.Popen(
        [sys.executable, str(EXAMPLES / "joints.py"), site.router],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        lines = [program.stdout.readline() for _ in range(3)]
        program.stdout.close()
        assert (program.stderr.read(), program.wait(40)) == ("", 0)
    finally:
        program.kill()
        program.wait()
        program.stderr.close()
    assert all(line.startswith("robomesh/test/arm/joints/slow waist ") for line in lines)


@pytest.mark.parametrize(
    "arguments", [("check.py", "examples/square.program"), ("inverse.py", "400", "0", "300")]
)
def test_what_nobody_reads_any_more_ends_quietly(site, arguments):
    reader, writer = os.pipe()
    os.close(reader)
    name, *words = arguments
    try:
        result = subprocess.run(
            [sys.executable, f"examples/{name}", *words, "test/arm", site.router],
            stdout=writer,
            stderr=subprocess.PIPE,
            timeout=60,
            cwd=EXAMPLES.parent,
        )
    finally:
        os.close(writer)
    assert (result.stderr, result.returncode) == (b"", -signal.SIGPIPE)


def test_home_goes_home_and_gives_control_back(site):
    result = subprocess.run(
        [sys.executable, str(EXAMPLES / "home.py"), "test/arm", site.router],
        capture_output=True,
        text=True,
        timeout=40,
        cwd=EXAMPLES.parent,
    )
    assert result.stdout.splitlines()[-1] == "home", result.stderr
    assert '"holder": ""' in site.command("list", "--json").stdout


def test_check_says_what_a_program_would_do_on_the_mesh(site):
    result = subprocess.run(
        [sys.executable, "examples/check.py", "examples/square.program", "test/arm", site.router],
        capture_output=True,
        text=True,
        timeout=60,
        cwd=EXAMPLES.parent,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    assert result.stdout.endswith(" s, nothing wrong\n")


@pytest.mark.parametrize(("place", "status", "words"), [("400", 0, " solution"), ("4000", 1, "reach")])
def test_inverse_says_where_the_joints_must_be_or_why_they_cannot(site, place, status, words):
    result = subprocess.run(
        [sys.executable, "examples/inverse.py", place, "0", "300", "test/arm", site.router],
        capture_output=True,
        text=True,
        timeout=60,
        cwd=EXAMPLES.parent,
    )
    assert result.returncode == status, result.stdout + result.stderr
    *solutions, end = result.stdout.splitlines()
    assert words in end
    assert all(line.startswith("waist ") for line in solutions)
    assert bool(solutions) is (status == 0)


@pytest.mark.parametrize(
    "arguments",
    [
        ("home.py", "demo/pt600", "tcp/127.0.0.1:1"),
        ("check.py", "examples/square.program", "demo/pt600", "tcp/127.0.0.1:1"),
        ("inverse.py", "400", "0", "300", "demo/pt600", "tcp/127.0.0.1:1"),
        ("joints.py", "tcp/127.0.0.1:1"),
        ("plot.py", "absent.mcap", "picture.png"),
    ],
)
def test_an_example_reports_what_it_cannot_do_in_one_line(arguments):
    name, *words = arguments
    result = subprocess.run(
        [sys.executable, f"examples/{name}", *words],
        capture_output=True,
        text=True,
        timeout=60,
        cwd=EXAMPLES.parent,
    )
    assert result.returncode == 1, result.stdout + result.stderr
    assert result.stderr.startswith("not done: ")
    assert len(result.stderr.splitlines()) == 1


def test_plot_draws_a_recording(tmp_path):
    path, picture = tmp_path / "trial.mcap", tmp_path / "trial.png"
    with Written(path) as file:
        for number in range(100):
            state = schema.KinematicState(tool_to_base=[1, 0, 0, 0.5, 0, 1, 0, 0.1, 0, 0, 1, 0.2, 0, 0, 0, 1])
            file.put("joints", joints(waist=number / 100, elbow=-number / 100), number / 100)
            file.put("kinematics", state, number / 100)
        described = (schema.Description.Joint(name=name, type="ROTARY") for name in ("waist", "elbow"))
        file.put("description", schema.Description(joints=described), 1.0)
    subprocess.run(
        [sys.executable, str(EXAMPLES / "plot.py"), str(path), str(picture)], check=True, timeout=60
    )
    assert picture.read_bytes().startswith(b"\x89PNG")
