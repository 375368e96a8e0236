"""What Define's worker may do and may not, however this version of Python begins a process."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

SCRIPT = """
import os, socket, subprocess, sys
from pathlib import Path
from services.console.define.sandbox import confine
folder = Path(sys.argv[1])
confine(folder)
(folder / "robot.toml").write_text("mine")
assert (folder / "robot.toml").read_text() == "mine"
words = [sys.executable, "-c", "print('read by this Python')"]
for options in ({}, {"close_fds": False}):
    assert subprocess.run(words, capture_output=True, text=True, **options).stdout == "read by this Python\\n"
pid = os.posix_spawn(sys.executable, words, os.environ)
assert os.waitpid(pid, 0)[1] == 0
for name, forbidden in {
    "subprocess": lambda: subprocess.run(["/bin/true"]),
    "subprocess without closing": lambda: subprocess.run(["/bin/true"], close_fds=False),
    "posix_spawn": lambda: os.posix_spawn("/bin/true", ["true"], {}),
    "posix_spawn of bytes": lambda: os.posix_spawn(b"/bin/true", ["true"], {}),
    "system": lambda: os.system("true"),
    "exec": lambda: os.execv("/bin/true", ["true"]),
    "network": lambda: socket.create_connection(("127.0.0.1", 9)),
    "reading": lambda: open("/etc/passwd"),
    "writing": lambda: open(folder.parent / "outside", "w"),
    "writing code": lambda: open(subprocess.__file__, "a"),
}.items():
    try:
        forbidden()
    except PermissionError:
        continue
    sys.exit(f"{name} is allowed")
"""


def test_a_confined_process_may_only_start_this_python_and_use_its_folder(tmp_path):
    folder = tmp_path / "draft"
    folder.mkdir()
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(folder)],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert not (tmp_path / "outside").exists()
