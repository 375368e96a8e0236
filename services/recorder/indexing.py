"""Queue that indexes closed files and recovers unfinished ones, one at a time, in a separate process."""

import asyncio
import logging
import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from robomesh.files.worker import Worker, WorkerError
from robomesh.recordings.errors import CaptureError

log = logging.getLogger(__name__)

# Time without a job after which the process is stopped.
_IDLE_S = 10.0
_ERRNO = re.compile(r"^\[Errno \d+\] ")


@dataclass(frozen=True)
class Job:
    """Files to merge into one.

    Attributes:
        about: Metadata to add to, or replace in, that of the first source.
        done: Called afterwards with the problem as text, or None after success.
    """

    target: Path
    sources: tuple[Path, ...]
    about: dict[str, str] = field(default_factory=dict)
    done: Callable[[str | None], None] = lambda _: None


class IndexingQueue:
    """Queue of jobs, run one by one by `serve`."""

    def __init__(self) -> None:
        self._jobs: asyncio.Queue[Job] = asyncio.Queue()
        self._worker = Worker("robomesh.recordings.recovery.rewrite", None, nice=10)
        # Progress of running and waiting jobs, by the target's name: 0 to 1.
        self.progress: dict[str, float] = {}

    def submit(self, job: Job) -> None:
        """Add a job to the queue."""
        self.progress[job.target.name] = 0.0
        self._jobs.put_nowait(job)

    async def serve(self) -> None:
        """Run jobs until cancelled; a job that is cancelled leaves its files unchanged."""
        try:
            while True:
                if (job := await self._next()) is None:
                    await self._worker.close()
                    job = await self._jobs.get()
                self._end(job, await self._do(job))
        finally:
            await self._worker.close()

    async def _next(self) -> Job | None:
        with suppress(TimeoutError):
            async with asyncio.timeout(_IDLE_S):
                return await self._jobs.get()
        return None

    def _end(self, job: Job, problem: str | None) -> None:
        self.progress.pop(job.target.name, None)
        if problem is not None:
            log.error("%s: not indexed: %s", job.target, problem)
        try:
            job.done(problem)
        except Exception:
            log.exception("%s: the callback of its job failed", job.target)

    async def _do(self, job: Job) -> str | None:
        """Run a job; return the problem as text, or None."""
        name = job.target.name

        def set_progress(part: float) -> None:
            self.progress[name] = part

        question = job.sources, job.target, job.about
        try:
            await self._worker.ask(question, timeout_s=None, on_report=set_progress)
        except (CaptureError, OSError, WorkerError) as error:
            return _ERRNO.sub("", str(error))
        except Exception as error:
            return repr(error)  # for example a damage that `rewrite` does not know; the queue continues
        return None
