"""Parts of the supervisor; test_whole_site tests a whole site."""

import asyncio
import contextlib
import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from services import supervisor
from services.supervisor import CouldNotStartError, SupervisedProgram, _lines, supervise
from tests.conftest import run
from tests.ports import free_port
from tests.site import alive, wait_until

FORKING = """
import asyncio, sys
from services import supervisor
from services.command_line import main
from services.supervisor import SupervisedProgram, fork, supervise
supervisor._OTHERS_AFTER_S = 1000.0
programs = [
    SupervisedProgram(name=words[0], arguments=tuple(words[1:]), required=words[0] != "optional")
    for words in map(str.split, sys.argv[1:])
]
async def ready():
    if not any(each.name == "endless" for each in programs):
        return
    await asyncio.Event().wait()
write = lambda line: print(line, flush=True)
forked = fork(programs, main.main)
asyncio.run(supervise(programs, ready=ready, write=write, forked=forked))
"""


async def test_lines_of_any_length_and_any_bytes_are_read():
    stream = asyncio.StreamReader()
    stream.feed_data(b"one\n" + b"x" * 200_000 + b"\ntw\xff\no\nlast")
    stream.feed_eof()
    lines = [line async for line in _lines(stream)]
    assert [line[:4] for line in lines] == ["one", "xxxx", "tw\ufffd", "o", "last"]
    assert len(lines[1]) == 2000


@pytest.mark.slow
def test_only_a_required_program_that_cannot_start_ends_the_others(monkeypatch):
    monkeypatch.setattr("services.supervisor._COULD_NOT_START_S", 0.1)

    async def never():
        await asyncio.Event().wait()

    log = []

    async def main(required):
        wrong = SupervisedProgram(name="wrong", arguments=("robot", "show", "nobody"), required=required)
        await supervise([wrong], ready=never, write=log.append)

    with pytest.raises(CouldNotStartError, match="wrong could not start"):
        run(main(required=True))
    assert "wrong | robomesh: nobody: no such robot" in log[0]
    log.clear()

    async def without_it():
        task = asyncio.create_task(main(required=False))
        # It is tried again.
        while sum("wrong | could not start; everything else runs without it" in line for line in log) < 2:
            await asyncio.sleep(0.02)
        assert not task.done()
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    run(without_it())


@pytest.mark.slow
async def test_extra_programs_start_and_stop_while_the_others_run():
    wanted, log = {}, []

    def group(name):
        arguments = ("simulate", "--listen", "127.0.0.1:0")
        return lambda: [SupervisedProgram(name=name, arguments=arguments, required=False)]

    async def until(condition):
        while not condition():
            await asyncio.sleep(0.02)

    def logged(name, words):
        return sum(line.startswith(name) and words in line for line in list(log))

    async def steps():
        wanted["one"] = group("one")
        await until(lambda: logged("one", "listening"))
        wanted["two"] = group("two")
        await until(lambda: logged("two", "listening"))
        del wanted["one"]
        wanted["one again"] = group("one")
        await until(lambda: logged("one", "listening") == 2)
        assert logged("two", "listening") == 1
        assert not logged("one", "ended"), "an intended stop is logged as a failure"

    supervising = asyncio.create_task(
        supervise(
            [SupervisedProgram(name="rest", arguments=("simulate", "--listen", "127.0.0.1:0"))],
            ready=lambda: asyncio.Event().wait(),
            write=log.append,
            extra=lambda: dict(wanted),
        )
    )
    await steps()
    supervising.cancel()
    await asyncio.gather(supervising, return_exceptions=True)
    assert logged("rest", "listening") == 1


@pytest.mark.slow
def test_a_blocked_terminal_does_not_block_a_service():
    # The test does not read the pipe: lines that do not fit are dropped.
    program = (
        "import logging, time\n"
        "from robomesh.service.service import log_to_stderr\n"
        "log_to_stderr()\n"
        "begun = time.monotonic()\n"
        "for number in range(20000): logging.getLogger('x').info('a line of some length %d', number)\n"
        "print(time.monotonic() - begun, flush=True)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout.readline().strip()
        process.wait(60.0)
    finally:
        process.kill()
        process.communicate()


@pytest.mark.slow
async def test_a_standby_replaces_a_killed_process(tmp_path, monkeypatch):
    monkeypatch.setattr(supervisor, "_STANDBY_AFTER_S", 0.1)
    site = tmp_path / "site.toml"
    site.write_text(f'site = "hall"\n[router]\nlisten = ["tcp/127.0.0.1:{free_port()}"]\n')
    router = SupervisedProgram(name="router", arguments=("router", "--site", str(site)), standby=True)
    log = []

    # Another test may have left the process that forks commands (tests/warm.py).
    before = {each.pid for each in psutil.Process().children()}

    def pids():
        return sorted({each.pid for each in psutil.Process().children()} - before)

    async def until(condition):
        while not condition():
            await asyncio.sleep(0.02)

    task = asyncio.create_task(supervise([router], ready=asyncio.Event().wait, write=log.append))
    await until(lambda: sum("routing on" in line for line in log) == 1)
    await until(lambda: len(pids()) == 2)
    serving, standby = pids()
    os.kill(serving, signal.SIGKILL)
    await until(lambda: sum("routing on" in line for line in log) == 2)
    await until(lambda: serving not in pids() and len(pids()) == 2)
    assert standby in pids()
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    assert not pids()


@pytest.mark.slow
async def test_a_temporary_lack_of_processes_ends_no_program(monkeypatch):
    start, failures, log = supervisor._start, [], []

    async def short_of_processes(program, **how):
        if program.name == "late" and len(failures) < 2:
            failures.append(program)
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        return await start(program, **how)

    monkeypatch.setattr(supervisor, "_start", short_of_processes)
    programs = [
        SupervisedProgram(name=name, arguments=("simulate", "--listen", "127.0.0.1:0"))
        for name in ("rest", "late")
    ]

    def lines(name, words):
        return [line for line in log if line.startswith(name) and words in line]

    supervising = asyncio.create_task(supervise(programs, ready=asyncio.Event().wait, write=log.append))
    while not (lines("rest", "listening") and lines("late", "listening")):
        assert not supervising.done()
        await asyncio.sleep(0.02)
    supervising.cancel()
    await asyncio.gather(supervising, return_exceptions=True)
    assert len(lines("late", "could not be started: Resource temporarily unavailable; restarting in")) == 2
    assert not lines("rest", "ended")


@contextlib.contextmanager
def forking(*programs, code=FORKING, **how):
    """Yield a supervisor that has forked programs, each given as its name and its arguments."""
    process = subprocess.Popen(
        [sys.executable, "-c", code, *programs],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        **how,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def until_line(process, words):
    """Read its log up to a line with these words."""
    for line in process.stdout:
        if words in line:
            return line
    raise AssertionError(f"no line with {words!r}")


def children_of(process):
    """Return the process id of each child by its name in `ps`."""
    return {each.name(): each.pid for each in psutil.Process(process.pid).children()}


def pipes_of(pid):
    """Return the pipes that a process has open."""
    links = [str(each.readlink()) for each in Path(f"/proc/{pid}/fd").iterdir()]
    return {link for link in links if link.startswith("pipe:")}


@pytest.mark.slow
def test_a_killed_fork_is_replaced_by_a_new_python_and_the_others_do_not_notice():
    simulate = "simulate --listen 127.0.0.1:0"
    with forking(f"one {simulate}", f"optional {simulate}") as process:
        for _ in range(2):
            until_line(process, "listening on")
        before = children_of(process)
        assert before.keys() == {"one", "optional"}
        shown = " ".join(psutil.Process(before["one"]).cmdline())
        # A small environment leaves little room for it.
        assert shown.strip().partition("services.command_line.main ")[2].startswith("simulate")
        assert os.getsid(before["one"]) == before["one"], "Ctrl-C in a terminal reaches it"
        assert not pipes_of(before["one"]) & pipes_of(before["optional"])
        os.kill(before["one"], signal.SIGKILL)
        until_line(process, "one      | ended (killed by SIGKILL); restarting in 0.1 s")
        until_line(process, "one      | listening on")
        after = children_of(process)
        assert "one" not in after
        assert after["optional"] == before["optional"]
        process.kill()
        wait_until(lambda: not any(map(alive, (*before.values(), *after.values()))), what="orphans")


@pytest.mark.slow
def test_an_optional_fork_waits_for_the_site_and_no_fork_outlives_its_supervisor():
    with forking("endless simulate --listen 127.0.0.1:0", "optional robot show nobody") as process:
        until_line(process, "endless  | listening on")
        forks = children_of(process)
        assert forks.keys() == {"endless", "optional"}, "it has run and ended before the site is ready"
        process.kill()
        wait_until(lambda: not any(map(alive, forks.values())), what="orphans")


@pytest.mark.slow
def test_a_fault_of_a_forks_code_is_in_the_log():
    faulty = FORKING.replace("main.main", "lambda: 1 / 0")
    with forking("endless x", code=faulty) as process:
        until_line(process, "endless | ZeroDivisionError")
        until_line(process, "endless | ended (exit status 1); restarting in 0.1 s")


@pytest.mark.slow
@pytest.mark.parametrize("closed", [0, 1, 2])
def test_a_fork_that_cannot_start_is_reported_as_any_other(closed):
    with forking("optional robot show nobody", preexec_fn=lambda: closed == 1 or os.close(closed)) as process:
        until_line(process, "optional | robomesh: nobody: no such robot")
        until_line(process, "optional | could not start; everything else runs without it")


@pytest.mark.slow
def test_what_the_supervisor_imports_leaves_a_process_that_can_be_forked():
    # Before a fork OpenBLAS ends its threads; whatever else has threads or files would break in the fork.
    program = (
        "import os, threading\n"
        "from services.command_line import main\n"
        "from services.command_line.site import app, up\n"
        "pid = os.fork()\n"
        "if not pid: os._exit(0)\n"
        "os.waitpid(pid, 0)\n"
        "print(len(os.listdir('/proc/self/task')), len(os.listdir('/proc/self/fd')))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["1", "4"], "threads; 0, 1, 2 and the folder"


def test_a_program_that_cannot_be_forked_is_left_to_the_supervisor(monkeypatch):
    def fork():
        raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))

    monkeypatch.setattr(os, "fork", fork)
    monkeypatch.setattr("gc.freeze", lambda: None)
    open_files = psutil.Process().num_fds()
    forked = supervisor.fork([SupervisedProgram(name="one", arguments=("simulate",))], lambda: None)
    os.close(forked.others)
    assert not forked.children
    assert psutil.Process().num_fds() == open_files
