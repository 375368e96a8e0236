"""The supervisor: a process a service, prefixed logs, restarts with back-off, all down in time.

It holds no robot state and is on no data path: killed, it takes its processes with it; a killed
process comes back, and the others do not notice. What is added while it runs comes and goes beside
the rest, in groups. Of what nobody can do without, another waits, loaded, to take its place.
"""

import asyncio
import contextlib
import ctypes
import os
import random
import signal
import sys
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Hashable, Mapping, Sequence
from dataclasses import dataclass

from services.errors import ServiceError

# A site is down within 2 s, unless a process still finishes what it writes.
_ASK_S = 1.2
_SAY_AFTER_S = 1.5
_FINISH_S = 10.0
_LAST_S = 0.3
# Longer than all of them together: after it `robomesh up` exits, whatever hangs.
ENDS_WITHIN_S = 13.0
_SHORTEST_WAIT_S = 0.1
_LONGEST_WAIT_S = 10.0
# What ran this long is taken for well: its next failure waits the shortest time again.
_WELL_AFTER_S = 20.0
_COULD_NOT = 2
_READ_BYTES = 1 << 16
_LONGEST_LINE = 2000
_PR_SET_PDEATHSIG = 1
_FOLLOW_EACH_S = 0.4
# A spare is loaded when what it stands by for has run this long: not while everything starts.
_SPARE_AFTER_S = 5.0
_SPARE = "ROBOMESH_SPARE"

# Groups of programs that are to run beside the others, now: a key that is new starts its own, one that
# is gone has them ended.
Following = Callable[[], Mapping[Hashable, Callable[[], Sequence["Program"]]]]


@dataclass(frozen=True, kw_only=True)
class Program:
    """A process to keep running.

    Attributes:
        needed: The site cannot do without it: when it cannot start at all, nothing starts.
        spare: Another process of it stands by (`wait_for_turn`): on a busy machine loading a service takes
            seconds, and starting one that is loaded does not.
        finishes: What it finishes at its end and no kill may cut, in words; empty: nothing.
        last: Ends after the others, which need it for that.
    """

    name: str
    arguments: tuple[str, ...]
    needed: bool = True
    spare: bool = False
    finishes: str = ""
    last: bool = False


@dataclass(frozen=True)
class _Running:
    program: Program
    process: asyncio.subprocess.Process


class CouldNotStartError(ServiceError):
    """A needed service says that it cannot run as it is configured; its own line said why."""


async def supervise(
    programs: Sequence[Program],
    *,
    ready: Callable[[], Awaitable[None]],
    write: Callable[[str], None],
    following: Following = dict,
) -> None:
    """Run the programs, in order, until cancelled; then end them. Cancelled again, kill them.

    Args:
        ready: Runs beside them; for whoever waits until the site is up.
        write: Takes a line of log.
        following: Asked again and again for what is to run beside them.

    Raises:
        CouldNotStartError: If a needed one exits with status 2 before it ever ran well.
    """
    width = max(len(program.name) for program in programs)
    running: dict[str, _Running] = {}

    def keep(program: Program) -> Coroutine[None, None, None]:
        return _keep(program, running, _prefixed(write, f"{program.name:<{width}} | "))

    try:
        async with asyncio.TaskGroup() as group:
            for program in programs:
                group.create_task(keep(program))
            group.create_task(_once(ready))
            group.create_task(_follow(following, running, keep, write))
    except ExceptionGroup as errors:
        # Not `except*`: before Python 3.11.4 what it raises comes out in a group again.
        could_not, others = errors.split(ServiceError)
        if others is not None or could_not is None:
            raise
        raise could_not.exceptions[0] from None
    finally:
        try:
            await _end([*running.values()], write)
        finally:
            await _kill([*running.values()])


def wait_for_turn() -> None:
    """As a spare, wait until the process that it stands by for has ended; as any other, not at all."""
    if not os.environ.pop(_SPARE, ""):
        return
    if not os.read(0, 1):
        sys.exit(0)  # the supervisor has ended
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)


def _prefixed(write: Callable[[str], None], prefix: str) -> Callable[[str], None]:
    return lambda line: write(prefix + line)


async def _follow(
    following: Following,
    running: dict[str, _Running],
    keep: Callable[[Program], Coroutine[None, None, None]],
    write: Callable[[str], None],
) -> None:
    """Start what is wanted and does not run yet; end what runs and is not wanted any more."""
    groups: dict[Hashable, list[tuple[Program, asyncio.Task[None]]]] = {}
    async with asyncio.TaskGroup() as tasks:
        while True:
            wanted = await asyncio.to_thread(following)
            gone = [each for key in list(groups) if key not in wanted for each in groups.pop(key)]
            for _, task in gone:
                task.cancel()
            # A robot that changed must have let go of its name before it comes again.
            await asyncio.gather(*(task for _, task in gone), return_exceptions=True)
            names = [program.name for program, _ in gone if program.name in running]
            await _end([running[name] for name in names], write)
            for name in names:
                del running[name]
            for key in wanted.keys() - groups.keys():
                groups[key] = [(each, tasks.create_task(keep(each))) for each in wanted[key]()]
            await asyncio.sleep(_FOLLOW_EACH_S)


async def _once(ready: Callable[[], Awaitable[None]]) -> None:
    await ready()


async def _keep(program: Program, running: dict[str, _Running], write: Callable[[str], None]) -> None:
    wait_s = _SHORTEST_WAIT_S
    ran_well = False
    while True:
        started = time.monotonic()
        status: int | None = None
        try:
            process = await _next(program, running)
        except OSError as error:  # no memory, or no process, is left just now: the others need not end too
            how = f"could not be started: {error.strerror}"
        else:
            running[program.name] = _Running(program, process)
            assert process.stdout is not None
            async with _standing_by(program, running):
                async for line in _lines(process.stdout):
                    write(line)
                status = await process.wait()
            how = f"ended ({_status(status)})"
        ran_s = time.monotonic() - started
        if status == _COULD_NOT and not ran_well and ran_s < _WELL_AFTER_S:
            if program.needed:
                raise CouldNotStartError(f"{program.name} could not start, so the site does not")
            write("could not start; everything else runs without it")
            return
        if ran_s > _WELL_AFTER_S:
            ran_well, wait_s = True, 0.0
        write(f"{how}; again {f'in {wait_s:.1f} s' if wait_s else 'at once'}")
        await asyncio.sleep(wait_s * random.uniform(0.8, 1.2))
        wait_s = min(max(2 * wait_s, _SHORTEST_WAIT_S), _LONGEST_WAIT_S)


async def _lines(stream: asyncio.StreamReader) -> AsyncIterator[str]:
    """Lines of log, cut where they are endless: no service may end the site by its words."""
    rest = b""
    while chunk := await stream.read(_READ_BYTES):
        *lines, rest = (rest + chunk).split(b"\n")
        for line in lines:
            yield line[:_LONGEST_LINE].decode(errors="replace").rstrip()
        rest = rest[:_LONGEST_LINE]
    if rest:
        yield rest.decode(errors="replace").rstrip()


async def _next(program: Program, running: dict[str, _Running]) -> asyncio.subprocess.Process:
    """The spare, told that it is its turn, or a new process."""
    waiting = running.pop(_spare(program), None)
    if waiting is None or waiting.process.returncode is not None:
        return await _start(program)
    spare = waiting.process
    assert spare.stdin is not None
    spare.stdin.write(b"\n")
    return spare


@contextlib.asynccontextmanager
async def _standing_by(program: Program, running: dict[str, _Running]) -> AsyncIterator[None]:
    """See to it that a spare is there, where there is to be one."""

    async def keep() -> None:
        while True:
            await asyncio.sleep(_SPARE_AFTER_S)
            with contextlib.suppress(OSError):  # the next time
                spare = await _start(program, spare=True)
                running[_spare(program)] = _Running(program, spare)
                await spare.wait()

    task = asyncio.create_task(keep()) if program.spare else None
    try:
        yield
    finally:
        if task is not None:
            task.cancel()
            # A spare that is being started is killed and waited for.
            await asyncio.gather(task, return_exceptions=True)


def _spare(program: Program) -> str:
    return f"{program.name}, spare"


async def _start(program: Program, *, spare: bool = False) -> asyncio.subprocess.Process:
    supervisor = os.getpid()

    def die_with_the_supervisor() -> None:
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != supervisor:
            os._exit(0)

    return await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "services.command_line.main",
        *program.arguments,
        stdin=asyncio.subprocess.PIPE if spare else asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
        # A terminal's Ctrl-C is for the supervisor, which ends the others in order.
        start_new_session=True,
        preexec_fn=die_with_the_supervisor,
        env={**_environment(), "PYTHONUNBUFFERED": "1", **({_SPARE: "1"} if spare else {})},
    )


def _environment() -> dict[str, str]:
    """Ours, but for the certificate of whoever started the site: services have their own."""
    return {name: value for name, value in os.environ.items() if name != "ROBOMESH_KEYS"}


async def _end(those: Sequence[_Running], write: Callable[[str], None]) -> None:
    """End processes: what finishes something is waited for, and what it needs ends after it."""
    before = [each for each in those if not each.program.last]
    _signal(before, signal.SIGTERM)
    finishing = [each for each in before if each.program.finishes]
    async with asyncio.TaskGroup() as group:
        group.create_task(_end_soon([each for each in before if not each.program.finishes]))
        group.create_task(_finish(finishing, write))
    last = [each for each in those if each.program.last]
    _signal(last, signal.SIGTERM)
    await _ended(last, within_s=_LAST_S)
    await _kill(last)


async def _end_soon(those: Sequence[_Running]) -> None:
    await _ended(those, within_s=_ASK_S)
    await _kill(those)


async def _finish(those: Sequence[_Running], write: Callable[[str], None]) -> None:
    await _ended(those, within_s=_SAY_AFTER_S)
    for each in _left(those):
        write(f"waiting for {each.program.name}: {each.program.finishes}; Ctrl-C again kills it")
    await _ended(those, within_s=_FINISH_S - _SAY_AFTER_S)
    for each in _left(those):
        write(f"{each.program.name} did not end within {_FINISH_S:.0f} s and is killed")
    await _kill(those)


async def _ended(those: Sequence[_Running], *, within_s: float) -> None:
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(within_s):
            await asyncio.gather(*(each.process.wait() for each in those))


async def _kill(those: Sequence[_Running]) -> None:
    _signal(those, signal.SIGKILL)
    await asyncio.gather(*(each.process.wait() for each in those))


def _left(those: Sequence[_Running]) -> list[_Running]:
    return [each for each in those if each.process.returncode is None]


def _signal(those: Sequence[_Running], number: signal.Signals) -> None:
    for each in _left(those):
        with contextlib.suppress(ProcessLookupError):
            each.process.send_signal(number)


def _status(status: int) -> str:
    return f"killed by {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
