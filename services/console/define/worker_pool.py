"""The console's worker processes: one for checks while the user types, two for long jobs.

They start when first needed and keep running, because their imports take over a second. A worker that hangs
or
crashes is stopped, and the next request starts another.
"""

import asyncio
import contextlib
import json
import logging
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from services.console.define.errors import RefusedRequest, TooSlowError
from services.console.fair_queue import AskerQueue

log = logging.getLogger(__name__)

_START_S = 60.0
_LONGEST_LINE = 64 * 1024**2


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits of a job.

    Attributes:
        quick_s: Time limit of a check while the user types.
        slow_s: Time limit for reading and converting files, and for studying links that touch at home.
        brief_s: The same in the brief worker, which must not wait for a slow file.
        memory_bytes: Memory limit of a worker.
    """

    quick_s: float = 10.0
    slow_s: float = 180.0
    brief_s: float = 10.0
    memory_bytes: int = 6 * 1024**3


class Worker:
    """One worker process; one job at a time."""

    def __init__(self, folder: Path, *, longest_s: float, memory_bytes: int) -> None:
        self._folder = folder
        self._longest_s = longest_s
        self._memory_bytes = memory_bytes
        self._process: asyncio.subprocess.Process | None = None
        self._temporary: Path | None = None

    @property
    def pid(self) -> int | None:
        """Process id; None if it does not run."""
        return None if self._process is None else self._process.pid

    async def run(
        self,
        job: str,
        folder: Path,
        request: dict[str, Any],
        *,
        wanted: Callable[[], Awaitable[bool]] | None = None,
    ) -> dict[str, Any]:
        """Run a job and return its result; only one at a time.

        Args:
            wanted: Returns whether the client still waits.

        Raises:
            TooSlowError: If it exceeds its time limit.
            RefusedRequest: If the worker refuses it or crashes, or the client has disconnected.
        """
        if wanted is not None and not await wanted():
            raise RefusedRequest(499, "the client has disconnected")
        line = json.dumps({"job": job, "folder": str(folder), "request": request}) + "\n"
        answer = await self._answer(job, line)
        if "refused" in answer:
            raise RefusedRequest(422, answer["refused"])
        done: dict[str, Any] = answer["done"]
        return done

    async def _answer(self, job: str, line: str) -> dict[str, Any]:
        # A crash may have another cause than this file, so it gets a second try.
        for _ in range(2):
            try:
                return await self._run_once(line)
            except (EOFError, ConnectionError):
                log.warning("the worker crashed while handling %s (status %s)", job, await self._end())
            except TimeoutError:
                await self._end()
                raise TooSlowError(
                    422, f"this took more than {self._longest_s:g} s and was stopped"
                ) from None
            except BaseException:
                # Cancelled: the next request must not read this one's answer.
                await self._end()
                raise
        raise RefusedRequest(
            422, "this crashed the worker process twice: it may be damaged, or need too much memory"
        )

    async def close(self) -> None:
        """Stop the process."""
        await self._end()

    async def _run_once(self, line: str) -> dict[str, Any]:
        process = self._process or await self._start()
        async with asyncio.timeout(self._longest_s):
            return await _ask(process, line)

    async def _start(self) -> asyncio.subprocess.Process:
        self._temporary = Path(tempfile.mkdtemp(dir=self._folder))
        self._process = process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "services.console.define.worker",
            str(os.getpid()),
            str(self._folder),
            str(self._memory_bytes),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            limit=_LONGEST_LINE,
            start_new_session=True,  # so that its children are killed with it
            # Removed with the worker.
            env={**os.environ, "TMPDIR": str(self._temporary), "XDG_CACHE_HOME": str(self._temporary)},
        )
        async with asyncio.timeout(_START_S):
            await _ask(process, "")
        return process

    async def _end(self) -> int | None:
        process, temporary = self._process, self._temporary
        if process is None:
            return None
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        # Cleared only after it has ended: if this wait is cancelled, another call of `close` waits.
        status = await process.wait()
        if self._process is process:
            self._process = None
        if temporary is not None:
            await asyncio.to_thread(shutil.rmtree, temporary, ignore_errors=True)
        return status


async def _ask(process: asyncio.subprocess.Process, line: str) -> dict[str, Any]:
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(line.encode())
    await process.stdin.drain()
    answer = await process.stdout.readline()
    if not answer.endswith(b"\n"):
        raise EOFError
    found: dict[str, Any] = json.loads(answer)
    return found


class Workers:
    """Workers that serve askers in turn, and in which slow jobs do not delay others.

    If the brief worker does not finish a job in time, the main worker runs it again. Slow jobs wait for each
    other; short jobs wait for the brief worker only.
    """

    def __init__(self, main: Worker, brief: Worker | None = None) -> None:
        self._main = main
        self._idle = [main] if brief is None else [main, brief]
        self._all = tuple(self._idle)
        self._fresh: AskerQueue[asyncio.Future[Worker]] = AskerQueue()
        self._slow: AskerQueue[asyncio.Future[Worker]] = AskerQueue()

    @property
    def pids(self) -> list[int]:
        """Process ids of the running workers."""
        return [worker.pid for worker in self._all if worker.pid is not None]

    async def run(
        self,
        job: str,
        folder: Path,
        request: dict[str, Any],
        *,
        asker: str = "",
        wanted: Callable[[], Awaitable[bool]] | None = None,
    ) -> dict[str, Any]:
        """Run a job and return its result.

        Args:
            asker: Name for taking turns.
            wanted: Returns whether the client still waits; called when the job's turn has come.

        Raises:
            RefusedRequest: If the worker refuses the job, exceeds its time or crashes, or the client has
                disconnected.
        """
        async with self._turn(self._fresh, asker) as worker:
            try:
                return await worker.run(job, folder, request, wanted=wanted)
            except TooSlowError:
                if worker is self._main:
                    raise
        async with self._turn(self._slow, asker) as worker:
            return await worker.run(job, folder, request, wanted=wanted)

    async def close(self) -> None:
        """Stop the processes."""
        await asyncio.gather(*(worker.close() for worker in self._all))

    @contextlib.asynccontextmanager
    async def _turn(self, queue: AskerQueue[asyncio.Future[Worker]], asker: str) -> AsyncIterator[Worker]:
        turn: asyncio.Future[Worker] = asyncio.get_running_loop().create_future()
        queue.add(asker, turn)
        self._assign_workers()
        try:
            yield await turn
        finally:
            # A cancelled asker holds no worker, unless it got one at the same moment.
            if turn.done() and not turn.cancelled():
                self._idle.append(turn.result())
                self._assign_workers()

    def _assign_workers(self) -> None:
        for worker in sorted(self._idle, key=self._all.index):
            turn = self._next(self._slow) if worker is self._main else None
            turn = turn or self._next(self._fresh)
            if turn is not None:
                self._idle.remove(worker)
                turn.set_result(worker)

    @staticmethod
    def _next(queue: AskerQueue[asyncio.Future[Worker]]) -> asyncio.Future[Worker] | None:
        while (turn := queue.take()) is not None:
            if not turn.done():
                return turn  # skips cancelled askers
        return None


class Workshop:
    """The workers: quick ones for checks while the user types, slow ones for files."""

    def __init__(self, folder: Path, limits: Limits) -> None:
        def worker(longest_s: float) -> Worker:
            return Worker(folder, longest_s=longest_s, memory_bytes=limits.memory_bytes)

        self.quick = Workers(worker(limits.quick_s))
        self.slow = Workers(worker(limits.slow_s), brief=worker(min(limits.brief_s, limits.slow_s)))

    async def close(self) -> None:
        """Stop all workers."""
        await asyncio.gather(self.quick.close(), self.slow.close())
