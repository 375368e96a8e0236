"""The tests of `pulled_cable.py`, in a network of their own."""

import subprocess
import sys
from pathlib import Path

import pytest

IN_OWN_NETWORK = ("unshare", "--net", "sh", "-c", 'ip link set lo up && "$@"', "sh")


@pytest.mark.slow
def test_a_pulled_cable_is_noticed_at_both_ends():
    try:
        able = subprocess.run(
            [*IN_OWN_NETWORK, "ip", "netns", "list"], capture_output=True, text=True, check=False
        )
    except FileNotFoundError as error:
        pytest.skip(f"no network of one's own to be had here: {error}")
    if able.returncode:
        pytest.skip(f"no network of one's own to be had here: {able.stderr.strip()}")
    tests = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist")
    file = Path(__file__).with_name("pulled_cable.py")
    done = subprocess.run([*IN_OWN_NETWORK, *tests, str(file)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
