"""Queue that indexes closed files and recovers unfinished ones, one at a time, in a separate process."""

import asyncio
import json
import logging
import re
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

log = logging.getLogger(__name__)

_MODULE = "mcap_files.reindex"
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


class Finisher:
    """Queue of jobs, run one by one by `serve`."""

    def __init__(self) -> None:
        self._jobs: asyncio.Queue[Job] = asyncio.Queue()
        # Progress of running and waiting jobs, by the target's name: 0 to 1.
        self.progress: dict[str, float] = {}

    def submit(self, job: Job) -> None:
        """Add a job to the queue."""
        self.progress[job.target.name] = 0.0
        self._jobs.put_nowait(job)

    async def serve(self) -> None:
        """Run jobs until cancelled; a job that is cancelled leaves its files unchanged."""
        while True:
            job: Job | None = await self._jobs.get()
            try:
                async with _process() as process:
                    while job is not None:
                        self._end(job, await self._do(process, job))
                        job = await self._next() if process.returncode is None else None
            except OSError as error:
                if job is not None:
                    self._end(job, f"its process cannot be started: {error.strerror}")

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

    async def _do(self, process: asyncio.subprocess.Process, job: Job) -> str | None:
        """Run a job; return the problem as text, or None."""
        assert process.stdin is not None
        assert process.stdout is not None
        sources = [str(each) for each in job.sources]
        request = {"target": str(job.target), "sources": sources, "about": job.about}
        with suppress(ConnectionError):
            process.stdin.write(json.dumps(request).encode() + b"\n")
            await process.stdin.drain()
        try:
            async for line in process.stdout:
                word, _, text = line.decode(errors="replace").strip().partition(" ")
                if word == "done":
                    return None
                if word == "failed":
                    return _ERRNO.sub("", text)
                self.progress[job.target.name] = float(word)
        except ValueError:  # its later output would be mistaken for the next job's
            process.kill()
            return f"its process sent an invalid line and ended with {await process.wait()}"
        return f"its process ended with {await process.wait()}"


@asynccontextmanager
async def _process() -> AsyncIterator[asyncio.subprocess.Process]:
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(sys.executable, "-m", _MODULE, stdin=pipe, stdout=pipe)
    try:
        yield process
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()
