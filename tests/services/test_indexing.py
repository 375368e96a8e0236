"""Queue of the recorder's worker process: a killed worker loses one job only, and its files stay."""

import asyncio
import contextlib
import os
import signal

import psutil
import pytest

from robomesh.recordings.recovery.recover import State, state_of
from services.recorder import indexing
from services.recorder.indexing import IndexingQueue, Job
from tests.robomesh.recordings.test_capture import write

pytestmark = pytest.mark.slow


@contextlib.asynccontextmanager
async def serving():
    queue = IndexingQueue()
    task = asyncio.create_task(queue.serve())
    try:
        yield queue
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def submit(queue, path):
    """Submit a job; return the future of its problem."""
    outcome = asyncio.get_running_loop().create_future()
    queue.submit(Job(path, (path,), done=outcome.set_result))
    return outcome


def worker_process():
    """Return the worker process of this process, or None."""
    for each in psutil.Process().children():
        with contextlib.suppress(psutil.NoSuchProcess):  # it has ended meanwhile
            if "robomesh.recordings.recovery.rewrite" in each.cmdline():
                return each
    return None


async def test_job_of_a_killed_worker_fails_and_the_next_job_is_done(tmp_path):
    first, second = tmp_path / "first.mcap", tmp_path / "second.mcap"
    write(first, range(100))
    write(second, range(100))
    before = second.read_bytes()
    async with serving() as queue:
        assert await submit(queue, first) is None
        assert state_of(first) is State.INDEXED
        worker = worker_process()
        worker.send_signal(signal.SIGSTOP)
        killed = submit(queue, second)
        while not queue._worker._turn.locked():
            await asyncio.sleep(0)
        os.kill(worker.pid, signal.SIGKILL)
        assert "crashed (status -9)" in await killed
        assert second.read_bytes() == before
        assert await submit(queue, second) is None
        assert queue.progress == {}
    assert worker_process() is None
    assert state_of(second) is State.INDEXED


async def test_problem_of_a_job_is_a_text_and_the_worker_goes_on(tmp_path):
    recording = tmp_path / "recording.mcap"
    write(recording, range(100))
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(b"no recording")

    async with serving() as queue:
        assert "damaged.mcap: not a readable recording" in await submit(queue, damaged)
        first = worker_process()
        assert "No such file" in await submit(queue, tmp_path / "missing.mcap")
        assert await submit(queue, recording) is None
        assert worker_process() == first


async def test_worker_of_an_idle_queue_is_ended_and_restarted(tmp_path, monkeypatch):
    monkeypatch.setattr(indexing, "_IDLE_S", 0.01)
    recording = tmp_path / "recording.mcap"
    write(recording, range(100))

    async with serving() as queue:
        assert await submit(queue, recording) is None
        async with asyncio.timeout(60):
            while worker_process() is not None:
                await asyncio.sleep(0.02)
        assert await submit(queue, recording) is None
