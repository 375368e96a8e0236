"""Commands of `robomesh` in processes with its modules loaded, since loading is most of what a command costs.

Each command is a process of its own, with its own exit status, output and signals.
`tests/robomesh/test_wheel.py` and the sites of processes start `robomesh` from nothing.
"""

import contextlib
import io
import multiprocessing
import os
import select
import signal
import subprocess
import sys
import tempfile
import termios
import threading
import time
import tty
from pathlib import Path
from typing import BinaryIO

_LOADED = (
    "tests.warm",
    "services.command_line.main",
    "services.command_line.commands",
    "services.site_file.site",
    "robomesh.wire.session",
    "robomesh.contract.messages",
    "numpy",
    "zenoh",
)
# A signal within a write would cut the output within a character or a sequence.
_PAUSE_S = 0.4
_LINES = 200
_forks = multiprocessing.get_context("forkserver")
_forks.set_forkserver_preload([*_LOADED])
# A start looks at all children, also at one that another thread is closing.
_children = threading.Lock()


def run(arguments: tuple[str, ...], *, timeout_s: float, text: str) -> subprocess.CompletedProcess[str]:
    """Run `robomesh` to its end.

    Raises:
        subprocess.TimeoutExpired: If it takes longer; it is killed.
    """
    sys.audit("subprocess.Popen", "robomesh", arguments, None, None)  # `--quick` refuses it
    with (
        tempfile.TemporaryFile() as given,
        tempfile.TemporaryFile() as out,
        tempfile.TemporaryFile() as errors,
    ):
        given.write(text.encode())
        given.seek(0)
        paths = tuple(f"/proc/{os.getpid()}/fd/{file.fileno()}" for file in (given, out, errors))
        process = _forks.Process(target=_command, args=(arguments, paths, str(Path.cwd()), dict(os.environ)))
        with _children:
            process.start()
        process.join(timeout_s)
        if process.exitcode is None:
            process.kill()
            process.join()
            raise subprocess.TimeoutExpired(["robomesh", *arguments], timeout_s, _read(out), _read(errors))
        status = process.exitcode
        with _children:
            process.close()
        return subprocess.CompletedProcess(["robomesh", *arguments], status, _read(out), _read(errors))


def on_terminal(
    arguments: tuple[str, ...], *, timeout_s: float, columns: int, until: str = ""
) -> tuple[int, bytes]:
    """Run `robomesh` on a new terminal; return its exit status and the bytes that the terminal received.

    Args:
        arguments: The command's words.
        timeout_s: Time to its end.
        columns: Width of the terminal.
        until: The command is interrupted when its output has this text and pauses; empty: it ends alone.

    Raises:
        subprocess.TimeoutExpired: If it takes longer; it is killed.
    """
    sys.audit("subprocess.Popen", "robomesh", arguments, None, None)  # `--quick` refuses it
    ours, theirs = os.openpty()
    try:
        termios.tcsetwinsize(theirs, (_LINES, columns))
        tty.setraw(theirs)
        path = os.ttyname(theirs)
        # A size in the environment has precedence over the terminal's.
        size = {"COLUMNS": str(columns), "LINES": str(_LINES)}
        environment = {**os.environ, "TERM": "xterm-256color", **size}
        process = _forks.Process(target=_command, args=(arguments, (path,) * 3, str(Path.cwd()), environment))
        with _children:
            process.start()
        received, deadline, interrupted = b"", time.monotonic() + timeout_s, not until
        while process.exitcode is None or select.select([ours], [], [], 0)[0]:
            wait_s = 0.02 if interrupted else _PAUSE_S
            if select.select([ours], [], [], wait_s)[0]:
                received += os.read(ours, 1 << 16)
            elif not interrupted and until.encode() in received:
                interrupted = True
                with contextlib.suppress(ProcessLookupError):
                    os.kill(process.pid or 0, signal.SIGINT)
            if time.monotonic() > deadline:
                process.kill()
                process.join()
                raise subprocess.TimeoutExpired(["robomesh", *arguments], timeout_s, received)
        status = process.exitcode
        with _children:
            process.close()
        return status or 0, received
    finally:
        os.close(ours)
        os.close(theirs)


def _read(file: BinaryIO) -> str:
    file.seek(0)
    return file.read().decode().replace("\r\n", "\n")


def _command(
    arguments: tuple[str, ...], paths: tuple[str, ...], folder: str, environment: dict[str, str]
) -> None:
    """Be `robomesh` with these arguments, in the folder and environment of the test."""
    for number, path in enumerate(paths):
        file = os.open(path, os.O_WRONLY | os.O_APPEND if number else os.O_RDONLY)
        os.dup2(file, number)
        os.close(file)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = ["robomesh", *arguments]
    sys.stdin, sys.stdout, sys.stderr = (
        io.TextIOWrapper(io.FileIO(number, mode, closefd=False), "utf-8", line_buffering=number == 2)
        for number, mode in enumerate("rww")
    )
    from services.command_line.main import main

    main()
