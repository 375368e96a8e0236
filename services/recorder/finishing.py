"""Closed files made quick to read, and killed ones whole, one after the other in a process of its own."""

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
# Then its process ends.
_IDLE_S = 10.0
_ERRNO = re.compile(r"^\[Errno \d+\] ")


@dataclass(frozen=True)
class Job:
    """Files that become one.

    Attributes:
        about: What the file says of itself more, or otherwise, than the first of them.
        done: Called afterwards; None: it succeeded, else why not.
    """

    target: Path
    sources: tuple[Path, ...]
    about: dict[str, str] = field(default_factory=dict)
    done: Callable[[str | None], None] = lambda _: None


class Finisher:
    """Does jobs one by one. `serve` runs it."""

    def __init__(self) -> None:
        self._jobs: asyncio.Queue[Job] = asyncio.Queue()
        # How far the files are that are worked on or wait for it, by name: 0 to 1.
        self.progress: dict[str, float] = {}

    def give(self, job: Job) -> None:
        """Do a job when those before it are done."""
        self.progress[job.target.name] = 0.0
        self._jobs.put_nowait(job)

    async def serve(self) -> None:
        """Do what is given until cancelled; the file that is worked on stays as it was then."""
        while True:
            job: Job | None = await self._jobs.get()
            try:
                async with _process() as process:
                    while job is not None:
                        self._end(job, await self._do(process, job))
                        job = await self._next() if process.returncode is None else None
            except OSError as error:
                if job is not None:
                    self._end(job, f"no process can be started for it: {error.strerror}")

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
            log.exception("%s: what follows its end failed", job.target)

    async def _do(self, process: asyncio.subprocess.Process, job: Job) -> str | None:
        """What was wrong, in words; None: nothing."""
        assert process.stdin is not None
        assert process.stdout is not None
        sources = [str(each) for each in job.sources]
        asked = {"target": str(job.target), "sources": sources, "about": job.about}
        with suppress(ConnectionError):
            process.stdin.write(json.dumps(asked).encode() + b"\n")
            await process.stdin.drain()
        try:
            async for line in process.stdout:
                word, _, text = line.decode(errors="replace").strip().partition(" ")
                if word == "done":
                    return None
                if word == "failed":
                    return _ERRNO.sub("", text)
                self.progress[job.target.name] = float(word)
        except ValueError:  # what it says later would be taken for another job's
            process.kill()
            return f"its process ended with {await process.wait()}, after words of its own"
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
