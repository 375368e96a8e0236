"""The console's worker processes: one for checks while the user types, two for long jobs.

They start when first needed and keep running, because their imports take over a second. A worker that hangs
or crashes is stopped, and the next request starts another.
"""

import asyncio
import contextlib
import logging
import secrets
import shutil
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robomesh import reason_codes as codes
from robomesh.files.memory_limit import MEMORY_BYTES
from robomesh.files.worker import HandlerError, Worker, WorkerError, WorkerTimeoutError
from robomesh.reasons import Reason
from services.console.common.errors import RefusedRequest, TooSlowError
from services.console.common.fair_queue import AskerQueue

log = logging.getLogger(__name__)

_MODULE = "services.console.define.worker"


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
    memory_bytes: int = MEMORY_BYTES


class ConfinedWorker:
    """Worker process that can open only the store and program code, with a time limit for each job."""

    def __init__(self, folder: Path, *, longest_s: float, memory_bytes: int) -> None:
        self._longest_s = longest_s
        # The store removes it, too, if this process is killed.
        self._temporary = folder / f"tmp-{secrets.token_hex(8)}"
        settings = folder, self._temporary, memory_bytes
        self._worker = Worker(_MODULE, settings, memory_bytes=memory_bytes, untrusted=True)

    @property
    def pid(self) -> int | None:
        """Process id; None if it does not run."""
        return self._worker.pid

    async def run(
        self,
        job: str,
        folder: Path,
        request: dict[str, Any],
        *,
        wanted: Callable[[], Awaitable[bool]] | None = None,
    ) -> dict[str, Any]:
        """Run a job and return its result.

        Args:
            wanted: Returns whether the client still waits.

        Raises:
            TooSlowError: If it exceeds its time limit.
            RefusedRequest: If the worker refuses it or crashes, or the client has disconnected.
        """
        if wanted is not None and not await wanted():
            raise RefusedRequest(499, codes.ABANDONED())
        failure = ""
        # A crash may have another cause than this file, so it gets a second try.
        for _ in range(2):
            try:
                answer: dict[str, Any] = await self._worker.ask(
                    (job, folder, request), timeout_s=self._longest_s
                )
                break
            except HandlerError as error:
                raise RefusedRequest(422, codes.FAILED(request=f"define/{job}", detail=error)) from None
            except WorkerTimeoutError:
                raise TooSlowError(422, codes.DEFINE_TOO_SLOW(seconds=self._longest_s)) from None
            except WorkerError as error:
                failure = str(error)
                log.warning("%s: %s", job, failure)
        else:
            raise RefusedRequest(422, codes.DEFINE_CRASHED(detail=failure))
        if "refused" in answer:
            raise RefusedRequest(422, Reason(**answer["refused"]))
        done: dict[str, Any] = answer["done"]
        return done

    async def close(self) -> None:
        """Stop the process and remove its temporary files."""
        await self._worker.close()
        await asyncio.to_thread(shutil.rmtree, self._temporary, ignore_errors=True)


class Workers:
    """Workers that serve askers in turn, and in which slow jobs do not delay others.

    If the brief worker does not finish a job in time, the main worker runs it again. Slow jobs wait for each
    other; short jobs wait for the brief worker only.
    """

    def __init__(self, main: ConfinedWorker, brief: ConfinedWorker | None = None) -> None:
        self._main = main
        self._idle = [main] if brief is None else [main, brief]
        self._all = tuple(self._idle)
        self._fresh: AskerQueue[asyncio.Future[ConfinedWorker]] = AskerQueue()
        self._slow: AskerQueue[asyncio.Future[ConfinedWorker]] = AskerQueue()

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
    async def _turn(
        self, queue: AskerQueue[asyncio.Future[ConfinedWorker]], asker: str
    ) -> AsyncIterator[ConfinedWorker]:
        turn: asyncio.Future[ConfinedWorker] = asyncio.get_running_loop().create_future()
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
    def _next(queue: AskerQueue[asyncio.Future[ConfinedWorker]]) -> asyncio.Future[ConfinedWorker] | None:
        while (turn := queue.take()) is not None:
            if not turn.done():
                return turn  # skips cancelled askers
        return None


class Workshop:
    """The workers: quick ones for checks while the user types, slow ones for files."""

    def __init__(self, folder: Path, limits: Limits) -> None:
        def worker(longest_s: float) -> ConfinedWorker:
            return ConfinedWorker(folder, longest_s=longest_s, memory_bytes=limits.memory_bytes)

        self.quick = Workers(worker(limits.quick_s))
        self.slow = Workers(worker(limits.slow_s), brief=worker(min(limits.brief_s, limits.slow_s)))

    async def close(self) -> None:
        """Stop all workers."""
        await asyncio.gather(self.quick.close(), self.slow.close())
