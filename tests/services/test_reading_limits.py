"""Limits of commands that read untrusted files: at a limit of memory or time they end with one line."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]


def ended(script: str) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False, cwd=ROOT, timeout=60
    )
    return done.returncode, done.stderr


def test_a_command_that_takes_too_long_ends_with_one_line() -> None:
    script = (
        "import time; from services.command_line.terminal.reading_limits import limit\n"
        "limit('mesh', longest_s=0.2)\n"
        "while True: sum(range(1000))\n"
    )
    assert ended(script) == (2, "robomesh: this took more than 0.2 s and was ended\n")


def test_a_command_that_takes_too_much_memory_ends_with_one_line() -> None:
    script = (
        "import sys\n"
        "from services.command_line import main\n"
        "from robots.shapes.files import read\n"
        "read.read_geometry = lambda *_, **__: bytearray(2 << 30)\n"
        "main.limit = lambda *words, given=main.limit: given(*words, most_bytes=1 << 30)\n"
        "sys.argv = ['robomesh', 'mesh', 'info', 'x.stl']\n"
        "main.main()\n"
    )
    status, error = ended(script)
    assert (status, len(error.splitlines())) == (2, 1)
    assert "memory" in error


def test_other_commands_and_those_that_wait_for_a_person_have_no_clock() -> None:
    script = (
        "import resource, threading; from services.command_line.terminal.reading_limits import limit\n"
        "before = resource.getrlimit(resource.RLIMIT_DATA)\n"
        "limit('up'); limit()\n"
        "assert resource.getrlimit(resource.RLIMIT_DATA) == before\n"
        "limit('robot', 'verify', 'hall/arm')\n"
        "assert threading.active_count() == 1\n"
    )
    assert ended(script) == (0, "")
