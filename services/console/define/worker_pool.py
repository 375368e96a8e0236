"""The console's end of its workers: one for what must answer as one types, two for what may take long.

Started when first needed and kept, for their imports cost over a second; one that hangs or dies
is ended and the next request starts another.
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
    """What a job may take.

    Attributes:
        quick_s: A check as one types.
        slow_s: Reading and converting files, studying links that touch at home.
        brief_s: The same, in the worker that no slow file may hold up.
        memory_bytes: Of a worker.
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
        """Of its process, while it has one."""
        return None if self._process is None else self._process.pid

    async def do(
        self,
        job: str,
        folder: Path,
        request: dict[str, Any],
        *,
        wanted: Callable[[], Awaitable[bool]] | None = None,
    ) -> dict[str, Any]:
        """What a job comes to; no other may be under way.

        Args:
            wanted: Whether somebody still waits for it.

        Raises:
            TooSlowError: If it took too long.
            RefusedRequest: If it says no, ended the process, or nobody waits for it any more.
        """
        if wanted is not None and not await wanted():
            raise RefusedRequest(499, "nobody waits for this any more")
        line = json.dumps({"job": job, "folder": str(folder), "request": request}) + "\n"
        answer = await self._answer(job, line)
        if "refused" in answer:
            raise RefusedRequest(422, answer["refused"])
        done: dict[str, Any] = answer["done"]
        return done

    async def _answer(self, job: str, line: str) -> dict[str, Any]:
        # A process may have died before, or of something else: one death is no proof against this file.
        for _ in range(2):
            try:
                return await self._once(line)
            except (EOFError, ConnectionError):
                log.warning("the worker ended over %s (status %s)", job, await self._end())
            except TimeoutError:
                await self._end()
                raise TooSlowError(422, f"this took more than {self._longest_s:g} s and was ended") from None
            except BaseException:
                # Whoever asked is gone; the answer must not be taken for the next one's.
                await self._end()
                raise
        raise RefusedRequest(
            422, "this ended the process that reads, twice: it may be damaged, or need too much memory"
        )

    async def close(self) -> None:
        """End the process."""
        await self._end()

    async def _once(self, line: str) -> dict[str, Any]:
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
            start_new_session=True,  # it is ended together with what it started
            # What it writes beside the store goes with it.
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
        # Kept until it has ended: the wait may be cancelled, and then another caller of `close` waits.
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
    """Workers whose askers take turns, and where no slow job holds up the others.

    A job that the brief worker does not finish in its time is begun again by the main one: slow jobs
    wait for each other, and small ones for the brief worker alone.
    """

    def __init__(self, main: Worker, brief: Worker | None = None) -> None:
        self._main = main
        self._idle = [main] if brief is None else [main, brief]
        self._all = tuple(self._idle)
        self._fresh: AskerQueue[asyncio.Future[Worker]] = AskerQueue()
        self._slow: AskerQueue[asyncio.Future[Worker]] = AskerQueue()

    @property
    def pids(self) -> list[int]:
        """Of their processes, those that run."""
        return [worker.pid for worker in self._all if worker.pid is not None]

    async def do(
        self,
        job: str,
        folder: Path,
        request: dict[str, Any],
        *,
        asker: str = "",
        wanted: Callable[[], Awaitable[bool]] | None = None,
    ) -> dict[str, Any]:
        """What a job comes to.

        Args:
            asker: Whose turn it takes.
            wanted: Whether somebody still waits for it, asked when its turn has come.

        Raises:
            RefusedRequest: If it says no, took too long, ended the process, or nobody waits for it any more.
        """
        async with self._turn(self._fresh, asker) as worker:
            try:
                return await worker.do(job, folder, request, wanted=wanted)
            except TooSlowError:
                if worker is self._main:
                    raise
        async with self._turn(self._slow, asker) as worker:
            return await worker.do(job, folder, request, wanted=wanted)

    async def close(self) -> None:
        """End their processes."""
        await asyncio.gather(*(worker.close() for worker in self._all))

    @contextlib.asynccontextmanager
    async def _turn(self, queue: AskerQueue[asyncio.Future[Worker]], asker: str) -> AsyncIterator[Worker]:
        turn: asyncio.Future[Worker] = asyncio.get_running_loop().create_future()
        queue.add(asker, turn)
        self._hand_out()
        try:
            yield await turn
        finally:
            # An asker who went while waiting holds no worker, unless one was handed out in that instant.
            if turn.done() and not turn.cancelled():
                self._idle.append(turn.result())
                self._hand_out()

    def _hand_out(self) -> None:
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
                return turn  # the others' askers have gone
        return None


class Workshop:
    """The workers: quick ones for what is asked as one types, slow ones for files."""

    def __init__(self, folder: Path, limits: Limits) -> None:
        def worker(longest_s: float) -> Worker:
            return Worker(folder, longest_s=longest_s, memory_bytes=limits.memory_bytes)

        self.quick = Workers(worker(limits.quick_s))
        self.slow = Workers(worker(limits.slow_s), brief=worker(min(limits.brief_s, limits.slow_s)))

    async def close(self) -> None:
        """End them all."""
        await asyncio.gather(self.quick.close(), self.slow.close())
