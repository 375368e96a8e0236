"""Parts of the supervisor; test_whole_site tests a whole site."""

import asyncio
import errno
import os
import signal
import subprocess
import sys

import psutil
import pytest

from services import supervisor
from services.supervisor import CouldNotStartError, Program, _lines, supervise
from tests.conftest import free_port, run


def test_lines_of_any_length_and_any_bytes_are_read():
    async def main():
        stream = asyncio.StreamReader()
        stream.feed_data(b"one\n" + b"x" * 200_000 + b"\ntw\xff\no\nlast")
        stream.feed_eof()
        return [line async for line in _lines(stream)]

    lines = run(main())
    assert [line[:4] for line in lines] == ["one", "xxxx", "tw\ufffd", "o", "last"]
    assert len(lines[1]) == 2000


@pytest.mark.slow
def test_only_a_required_program_that_cannot_start_ends_the_others():
    async def never():
        await asyncio.Event().wait()

    log = []

    async def main(required):
        wrong = Program(name="wrong", arguments=("robot", "show", "nobody"), required=required)
        await supervise([wrong], ready=never, write=log.append)

    with pytest.raises(CouldNotStartError, match="wrong could not start"):
        run(main(required=True))
    assert "wrong | robomesh: nobody: no such robot" in log[0]
    log.clear()

    async def without_it():
        task = asyncio.create_task(main(required=False))
        while "wrong | could not start; everything else runs without it" not in log:
            await asyncio.sleep(0.02)
        assert not task.done()
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    run(without_it())


@pytest.mark.slow
def test_extra_programs_start_and_stop_while_the_others_run():
    wanted, log = {}, []

    def group(name):
        arguments = ("simulate", "--listen", "127.0.0.1:0")
        return lambda: [Program(name=name, arguments=arguments, required=False)]

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

    async def main():
        supervising = asyncio.create_task(
            supervise(
                [Program(name="rest", arguments=("simulate", "--listen", "127.0.0.1:0"))],
                ready=lambda: asyncio.Event().wait(),
                write=log.append,
                extra=lambda: dict(wanted),
            )
        )
        await steps()
        supervising.cancel()
        await asyncio.gather(supervising, return_exceptions=True)
        assert logged("rest", "listening") == 1

    run(main())


@pytest.mark.slow
def test_a_blocked_terminal_does_not_block_a_service():
    # The test does not read the pipe: lines that do not fit are dropped.
    program = (
        "import logging, time\n"
        "from robomesh.service import log_to_stderr\n"
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
        process.wait(10.0)
    finally:
        process.kill()
        process.communicate()


@pytest.mark.slow
def test_a_standby_replaces_a_killed_process(tmp_path, monkeypatch):
    monkeypatch.setattr(supervisor, "_STANDBY_AFTER_S", 0.1)
    site = tmp_path / "site.toml"
    site.write_text(f'site = "hall"\n[router]\nlisten = ["tcp/127.0.0.1:{free_port()}"]\n')
    router = Program(name="router", arguments=("router", "--site", str(site)), standby=True)
    log = []

    # Another test may have left the process that forks commands (tests/warm.py).
    before = {each.pid for each in psutil.Process().children()}

    def pids():
        return sorted({each.pid for each in psutil.Process().children()} - before)

    async def until(condition):
        while not condition():
            await asyncio.sleep(0.02)

    async def main():
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

    run(main(), timeout_s=60.0)
    assert not pids()


@pytest.mark.slow
def test_a_temporary_lack_of_processes_ends_no_program(monkeypatch):
    start, failures, log = supervisor._start, [], []

    async def short_of_processes(program, **how):
        if program.name == "late" and len(failures) < 2:
            failures.append(program)
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        return await start(program, **how)

    monkeypatch.setattr(supervisor, "_start", short_of_processes)
    programs = [
        Program(name=name, arguments=("simulate", "--listen", "127.0.0.1:0")) for name in ("rest", "late")
    ]

    def lines(name, words):
        return [line for line in log if line.startswith(name) and words in line]

    async def main():
        supervising = asyncio.create_task(supervise(programs, ready=asyncio.Event().wait, write=log.append))
        while not (lines("rest", "listening") and lines("late", "listening")):
            assert not supervising.done()
            await asyncio.sleep(0.02)
        supervising.cancel()
        await asyncio.gather(supervising, return_exceptions=True)

    run(main())
    assert len(lines("late", "could not be started: Resource temporarily unavailable; restarting in")) == 2
    assert not lines("rest", "ended")
