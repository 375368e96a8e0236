"""Each example is a whole program, run as a user runs it."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.site import running_site

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    with running_site(tmp_path_factory.mktemp("site")) as running:
        yield running


def test_joints_prints_joints(site):
    program = subprocess.Popen(
        [sys.executable, str(EXAMPLES / "joints.py"), site.router], stdout=subprocess.PIPE, text=True
    )
    try:
        lines = [program.stdout.readline() for _ in range(3)]
    finally:
        program.kill()
        program.communicate()
    assert all(line.startswith("robomesh/test/arm/joints/slow waist ") for line in lines)


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
