"""Supervisor: one process for each service, prefixed logs, restarts with back-off, bounded shutdown.

It holds no robot state and is on no data path. If it is killed, its processes end too; a killed process is
restarted without an effect on the others. Groups of programs can be added and removed at run time. A critical
service has a warm standby process.

The first process of a program may be a fork of the supervisor (`fork`), which has imported most of what a
service imports. Each later one is a Python of its own: then the supervisor has threads and a Zenoh session,
of which a fork would have broken copies.
"""

import asyncio
import atexit
import contextlib
import ctypes
import gc
import os
import random
import signal
import sys
import time
import traceback
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple, NoReturn, Protocol

from setproctitle import setproctitle, setthreadtitle

from robomesh.errors import ListenError
from services.errors import ServiceError

# A site stops within 2 s, unless a process still has to finish its writes.
_STOP_S = 1.2
_REPORT_AFTER_S = 1.5
_FINISH_S = 10.0
_LAST_S = 0.3
# Longer than the sum of them: after it `robomesh up` exits even if a process hangs.
ENDS_WITHIN_S = 13.0
_SHORTEST_WAIT_S = 0.1
_LONGEST_WAIT_S = 10.0
# A program that the site can do without, and that could not start.
_COULD_NOT_START_S = 60.0
# A process that ran this long counts as healthy: its next restart is immediate.
_HEALTHY_AFTER_S = 20.0
_CANNOT_START = 2  # exit status
_READ_BYTES = 1 << 16
_LONGEST_LINE = 2000
_PR_SET_PDEATHSIG = 1
_POLL_S = 0.4
# A standby is started when its program has run this long, so that it does not slow down the site's start.
_STANDBY_AFTER_S = 5.0
_STANDBY = "ROBOMESH_SPARE"
# Forked processes that the site can do without begin when it is ready, or after this time.
_OTHERS_AFTER_S = 3.0

# Returns the groups of programs that should run in addition, now. A new key starts its group's programs; a
# removed key stops them.
ExtraPrograms = Callable[[], Mapping[Hashable, Callable[[], Sequence["SupervisedProgram"]]]]


@dataclass(frozen=True, kw_only=True)
class SupervisedProgram:
    """A process to keep running.

    Attributes:
        required: If it cannot start as it is configured (exit status 2), the whole site does not start.
        standby: A second process waits, loaded, to replace it (`wait_as_standby`): on a busy machine loading
            a service takes seconds.
        finishes: Description of the work that it must finish before it ends; empty for none.
        last: Stopped after the others, which need it to end.
    """

    name: str
    arguments: tuple[str, ...]
    required: bool = True
    standby: bool = False
    finishes: str = ""
    last: bool = False


class _Process(Protocol):
    """The part of asyncio's processes that the supervisor uses."""

    @property
    def returncode(self) -> int | None: ...
    @property
    def stdin(self) -> asyncio.StreamWriter | None: ...
    @property
    def stdout(self) -> asyncio.StreamReader | None: ...
    def send_signal(self, signal: int) -> None: ...
    async def wait(self) -> int: ...


@dataclass(frozen=True)
class _Running:
    program: SupervisedProgram
    process: _Process


class _Child(NamedTuple):
    """A forked process, and the ends to read of its output's pipe and of one that only its end closes."""

    pid: int
    output: int
    life: int


@dataclass(frozen=True)
class Forked:
    """Processes that were forked before the event loop.

    Attributes:
        children: By the program's name.
        others: Descriptor; closing it lets the processes begin that are not required.
    """

    children: dict[str, _Child]
    others: int


class CouldNotStartError(ServiceError):
    """A required service cannot run with its configuration; its log has the reason."""


def fork(programs: Sequence[SupervisedProgram], main: Callable[[], None]) -> Forked:
    """Fork a process for each program; those that cannot be forked are missing.

    Call it before the first thread, Zenoh session and event loop of this process.

    Args:
        main: The command line, which runs with the program's arguments in `sys.argv`.
    """
    # A pipe must not become standard input or output, if one is closed.
    while (file := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(file)
    # Otherwise the garbage collections of each process would copy the pages that they share.
    gc.freeze()
    supervisor, children = os.getpid(), dict[str, _Child]()
    held, others = os.pipe()
    for program in programs:
        files: list[int] = []
        try:
            files += os.pipe()
            files += os.pipe()
            pid = os.fork()
        except OSError:  # too few processes or descriptors: `supervise` tries again
            for file in files:
                os.close(file)
            continue
        output, written, life, own_life = files
        if not pid:
            _be(program, main, supervisor, written, held, own_life)
        for file in files[1::2]:
            os.close(file)
        children[program.name] = _Child(pid, output, life)
    os.close(held)
    return Forked(children, others)


async def supervise(
    programs: Sequence[SupervisedProgram],
    *,
    ready: Callable[[], Awaitable[None]],
    write: Callable[[str], None],
    extra: ExtraPrograms = dict,
    forked: Forked | None = None,
) -> None:
    """Run the programs, in order, until cancelled; then stop them. A second cancellation kills them.

    Args:
        forked: The first processes of the programs (`fork`).
        ready: Runs concurrently; may wait until the site is up and report it.
        write: Writes a line of log.
        extra: Polled for the programs to run in addition.

    Raises:
        CouldNotStartError: If a required program exits with status 2 before it was ever healthy.
    """
    width = max(len(program.name) for program in programs)
    running: dict[str, _Running] = {}
    first = {} if forked is None else await _adopt(forked)
    running |= {each.name: _Running(each, first[each.name]) for each in programs if each.name in first}

    def keep(program: SupervisedProgram) -> Coroutine[None, None, None]:
        prefixed = _prefixed(write, f"{program.name:<{width}} | ")
        return _keep_running(program, running, prefixed, first.pop(program.name, None))

    try:
        async with asyncio.TaskGroup() as group:
            for program in programs:
                group.create_task(keep(program))
            waiting = group.create_task(_once(ready))
            if forked is not None:
                group.create_task(_begin_others(forked, waiting))
            group.create_task(_run_extra(extra, running, keep, write))
    except ExceptionGroup as errors:
        # Not `except*`: before Python 3.11.4 an exception raised in it is wrapped in a group again.
        could_not, others = errors.split((ServiceError, ListenError))
        if others is not None or could_not is None:
            raise
        raise could_not.exceptions[0] from None
    finally:
        try:
            await _end([*running.values()], write)
        finally:
            await _kill([*running.values()])


def wait_as_standby() -> None:
    """In a standby process, wait until the serving process has ended; in any other, return immediately."""
    if not os.environ.pop(_STANDBY, ""):
        return
    if not os.read(0, 1):
        sys.exit(0)  # the supervisor has ended
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)


def _prefixed(write: Callable[[str], None], prefix: str) -> Callable[[str], None]:
    return lambda line: write(prefix + line)


async def _run_extra(
    extra: ExtraPrograms,
    running: dict[str, _Running],
    keep: Callable[[SupervisedProgram], Coroutine[None, None, None]],
    write: Callable[[str], None],
) -> None:
    """Start the extra programs that are new, and stop those that were removed."""
    groups: dict[Hashable, list[tuple[SupervisedProgram, asyncio.Task[None]]]] = {}
    async with asyncio.TaskGroup() as tasks:
        while True:
            wanted = await asyncio.to_thread(extra)
            removed = [each for key in list(groups) if key not in wanted for each in groups.pop(key)]
            for _, task in removed:
                task.cancel()
            # The old processes of a changed robot must release its name before the new ones start.
            await asyncio.gather(*(task for _, task in removed), return_exceptions=True)
            names = [program.name for program, _ in removed if program.name in running]
            await _end([running[name] for name in names], write)
            for name in names:
                del running[name]
            for key in wanted.keys() - groups.keys():
                groups[key] = [(each, tasks.create_task(keep(each))) for each in wanted[key]()]
            await asyncio.sleep(_POLL_S)


async def _once(ready: Callable[[], Awaitable[None]]) -> None:
    await ready()


async def _begin_others(forked: Forked, ready: asyncio.Task[None]) -> None:
    await asyncio.wait([ready], timeout=_OTHERS_AFTER_S)
    os.close(forked.others)


async def _keep_running(
    program: SupervisedProgram,
    running: dict[str, _Running],
    write: Callable[[str], None],
    first: _Process | None,
) -> None:
    wait_s = _SHORTEST_WAIT_S
    was_healthy = False
    while True:
        started = time.monotonic()
        status: int | None = None
        try:
            process, first = first or await _next(program, running), None
        except OSError as error:  # out of memory or processes: must not end the other programs
            outcome = f"could not be started: {error.strerror}"
        else:
            running[program.name] = _Running(program, process)
            assert process.stdout is not None
            async with _standby_of(program, running):
                async for line in _lines(process.stdout):
                    write(line)
                status = await process.wait()
            outcome = f"ended ({_status(status)})"
        ran_s = time.monotonic() - started
        if status == _CANNOT_START and not was_healthy and ran_s < _HEALTHY_AFTER_S:
            if program.required:
                raise CouldNotStartError(f"{program.name} could not start, so the site does not start")
            write(
                f"could not start; everything else runs without it; trying again in {_COULD_NOT_START_S:g} s"
            )
            await asyncio.sleep(_COULD_NOT_START_S)
            continue
        if ran_s > _HEALTHY_AFTER_S:
            was_healthy, wait_s = True, 0.0
        write(f"{outcome}; restarting {f'in {wait_s:.1f} s' if wait_s else 'now'}")
        await asyncio.sleep(wait_s * random.uniform(0.8, 1.2))
        wait_s = min(max(2 * wait_s, _SHORTEST_WAIT_S), _LONGEST_WAIT_S)


async def _lines(stream: asyncio.StreamReader) -> AsyncIterator[str]:
    """Yield lines of log, cut at a maximum length so that no service can exhaust the supervisor's memory."""
    rest = b""
    while chunk := await stream.read(_READ_BYTES):
        *lines, rest = (rest + chunk).split(b"\n")
        for line in lines:
            yield line[:_LONGEST_LINE].decode(errors="replace").rstrip()
        rest = rest[:_LONGEST_LINE]
    if rest:
        yield rest.decode(errors="replace").rstrip()


async def _next(program: SupervisedProgram, running: dict[str, _Running]) -> _Process:
    """Activate the standby process, or start a new one; return it."""
    waiting = running.pop(_standby_name(program), None)
    if waiting is None or waiting.process.returncode is not None:
        return await _start(program)
    standby = waiting.process
    assert standby.stdin is not None
    standby.stdin.write(b"\n")
    return standby


@contextlib.asynccontextmanager
async def _standby_of(program: SupervisedProgram, running: dict[str, _Running]) -> AsyncIterator[None]:
    """Keep a standby process during the block, if the program has one."""

    async def keep() -> None:
        while True:
            await asyncio.sleep(_STANDBY_AFTER_S)
            with contextlib.suppress(OSError):  # try again later
                standby = await _start(program, standby=True)
                running[_standby_name(program)] = _Running(program, standby)
                await standby.wait()

    task = asyncio.create_task(keep()) if program.standby else None
    try:
        yield
    finally:
        if task is not None:
            task.cancel()
            # Waits also for the kill of a standby that is being started.
            await asyncio.gather(task, return_exceptions=True)


def _standby_name(program: SupervisedProgram) -> str:
    return f"{program.name}, standby"


async def _start(program: SupervisedProgram, *, standby: bool = False) -> asyncio.subprocess.Process:
    supervisor = os.getpid()
    return await asyncio.create_subprocess_exec(
        *_words(program),
        stdin=asyncio.subprocess.PIPE if standby else asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
        # A terminal's Ctrl-C must reach only the supervisor, which stops the others in order.
        start_new_session=True,
        preexec_fn=lambda: _die_with(supervisor),
        env={**_environment(), **({_STANDBY: "1"} if standby else {})},
    )


def _words(program: SupervisedProgram) -> tuple[str, ...]:
    # -P: a file of the current folder must not hide a module.
    return (sys.executable, "-P", "-m", "services.command_line.main", *program.arguments)


def _environment() -> dict[str, str]:
    """Return this environment without the operator's certificate: services have their own certificates."""
    rest = {name: value for name, value in os.environ.items() if name != "ROBOMESH_KEYS"}
    return {**rest, "PYTHONUNBUFFERED": "1"}


def _die_with(supervisor: int) -> None:
    """Have the kernel end this process when the supervisor ends; in the new process."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != supervisor:
        os._exit(0)


def _be(
    program: SupervisedProgram,
    main: Callable[[], None],
    supervisor: int,
    output: int,
    held: int,
    life: int,
) -> NoReturn:
    """In a forked process, be what `_start` starts for the program.

    Args:
        output: Descriptor of its standard output and error.
        held: Descriptor whose end of file lets a program begin that is not required.
        life: Descriptor that stays open.
    """
    status: object = 1
    try:
        _die_with(supervisor)
        setproctitle(" ".join(_words(program)))
        setthreadtitle(program.name)
        os.setsid()
        nothing = os.open(os.devnull, os.O_RDONLY)
        for number, file in enumerate((nothing, output, output)):
            os.dup2(file, number)
        # The supervisor's, those of other processes, and those that the supervisor has inherited.
        for file in {int(each.name) for each in Path("/proc/self/fd").iterdir()} - {0, 1, 2, held, life}:
            with contextlib.suppress(OSError):  # that of the folder
                os.close(file)
        if not program.required:
            os.read(held, 1)
        os.close(held)
        sys.stdin, sys.stdout, sys.stderr = (
            os.fdopen(number, mode, buffering=1, errors="backslashreplace", closefd=False)
            for number, mode in enumerate("rww")
        )
        os.environ.pop("ROBOMESH_KEYS", None)
        os.environ.update(_environment())
        sys.argv = ["robomesh", *program.arguments]
        atexit._clear()
        main()
    except SystemExit as end:
        status = end.code
    except BaseException:
        traceback.print_exc()
    finally:
        # The supervisor's code must not go on in this process.
        atexit._run_exitfuncs()
        os._exit(status if isinstance(status, int) else 1)


async def _adopt(forked: Forked) -> dict[str, _Process]:
    """Read the output of forked processes, and wait for their ends, in this event loop."""
    loop, adopted = asyncio.get_running_loop(), dict[str, _Process]()
    for name, child in forked.children.items():
        adopted[name] = process = _ForkedProcess(child)
        protocol = partial(asyncio.StreamReaderProtocol, process.stdout)
        await loop.connect_read_pipe(protocol, os.fdopen(child.output, "rb", buffering=0))
        loop.add_reader(child.life, process.end)
    return adopted


class _ForkedProcess:
    """A forked process, as asyncio's processes are."""

    stdin: asyncio.StreamWriter | None = None

    def __init__(self, child: _Child) -> None:
        self._child, self._ended = child, asyncio.Event()
        self.stdout = asyncio.StreamReader()
        self.returncode: int | None = None

    def send_signal(self, signal: int) -> None:
        os.kill(self._child.pid, signal)

    async def wait(self) -> int:
        await self._ended.wait()
        assert self.returncode is not None
        return self.returncode

    def end(self) -> None:
        """Take its exit status; called when its end of the pipe `life` is closed."""
        asyncio.get_running_loop().remove_reader(self._child.life)
        os.close(self._child.life)
        _, status = os.waitpid(self._child.pid, 0)
        self.returncode = os.waitstatus_to_exitcode(status)
        self._ended.set()


async def _end(processes: Sequence[_Running], write: Callable[[str], None]) -> None:
    """Stop processes: wait for those that must finish their work, then stop the `last` ones."""
    first = [each for each in processes if not each.program.last]
    _signal(first, signal.SIGTERM)
    finishing = [each for each in first if each.program.finishes]
    async with asyncio.TaskGroup() as group:
        group.create_task(_end_soon([each for each in first if not each.program.finishes]))
        group.create_task(_finish(finishing, write))
    last = [each for each in processes if each.program.last]
    _signal(last, signal.SIGTERM)
    await _wait(last, within_s=_LAST_S)
    await _kill(last)


async def _end_soon(processes: Sequence[_Running]) -> None:
    await _wait(processes, within_s=_STOP_S)
    await _kill(processes)


async def _finish(processes: Sequence[_Running], write: Callable[[str], None]) -> None:
    await _wait(processes, within_s=_REPORT_AFTER_S)
    for each in _alive(processes):
        write(f"waiting for {each.program.name}: {each.program.finishes}; Ctrl-C again kills it")
    await _wait(processes, within_s=_FINISH_S - _REPORT_AFTER_S)
    for each in _alive(processes):
        write(f"{each.program.name} did not end within {_FINISH_S:.0f} s and is killed")
    await _kill(processes)


async def _wait(processes: Sequence[_Running], *, within_s: float) -> None:
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(within_s):
            await asyncio.gather(*(each.process.wait() for each in processes))


async def _kill(processes: Sequence[_Running]) -> None:
    _signal(processes, signal.SIGKILL)
    await asyncio.gather(*(each.process.wait() for each in processes))


def _alive(processes: Sequence[_Running]) -> list[_Running]:
    return [each for each in processes if each.process.returncode is None]


def _signal(processes: Sequence[_Running], number: signal.Signals) -> None:
    for each in _alive(processes):
        with contextlib.suppress(ProcessLookupError):
            each.process.send_signal(number)


def _status(status: int) -> str:
    return f"killed by {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
