import asyncio
import contextlib
import os
import pickle
import signal
import struct
import subprocess
import sys
from contextlib import asynccontextmanager
from subprocess import PIPE

import psutil
import pytest

from robomesh.files.worker import HandlerError, Worker, WorkerError, WorkerTimeoutError

CHILD = "tests.robomesh.echo_worker"


@asynccontextmanager
async def running(settings="settings", **options):
    worker = Worker(CHILD, settings, **options)
    try:
        yield worker
    finally:
        await worker.close()


@pytest.mark.slow
async def test_worker_answers_in_its_process_and_keeps_it():
    async with running() as worker:
        settings, pid, question = await worker.ask({"a": 1}, timeout_s=30)
        assert (settings, question) == ("settings", {"a": 1})
        assert pid not in (os.getpid(), None)
        assert (await worker.ask("print", timeout_s=30))[1] == pid == worker.pid
        assert await worker.ask(None, timeout_s=30) == ("settings", pid, None)


@pytest.mark.slow
async def test_handlers_exception_is_raised_and_the_process_goes_on():
    async with running() as worker:
        with pytest.raises(ValueError, match="no such pose"):
            await worker.ask(("fail", "no such pose"), timeout_s=30)
        pid = worker.pid
        with pytest.raises(RuntimeError, match="odd: odd"):
            await worker.ask(("fail twice", "odd"), timeout_s=30)
        assert (await worker.ask("hello", timeout_s=30))[1] == pid


@pytest.mark.slow
async def test_error_of_a_worker_that_cannot_begin_has_the_reason():
    async with running("wrong") as worker:
        with pytest.raises(WorkerError, match="settings are wrong"):
            await worker.start()
        with pytest.raises(WorkerError, match="settings are wrong"):
            await worker.ask("hello", timeout_s=30)


@pytest.mark.slow
async def test_worker_is_killed_on_timeout_and_the_next_question_starts_another():
    async with running() as worker:
        await worker.start()
        pid = worker.pid
        with pytest.raises(WorkerTimeoutError, match="no answer within"):
            await worker.ask(("sleep", 60), timeout_s=0.2)
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
        assert (await worker.ask("hello", timeout_s=30))[1] != pid


@pytest.mark.slow
async def test_crash_of_a_worker_is_an_error_and_the_worker_restarts():
    async with running() as worker:
        with pytest.raises(WorkerError, match="status 3"):
            await worker.ask("die", timeout_s=30)
        assert (await worker.ask("hello", timeout_s=30))[2] == "hello"


@pytest.mark.slow
async def test_answer_for_a_cancelled_caller_is_not_given_to_the_next():
    async with running() as worker:
        await worker.start()
        task = asyncio.create_task(worker.ask(("sleep", 60), timeout_s=60))
        await asyncio.sleep(0.1)
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
        assert (await worker.ask("mine", timeout_s=30))[2] == "mine"


@pytest.mark.slow
async def test_close_waits_for_a_process_that_another_caller_is_ending():
    async with running() as worker:
        await worker.start()
        process = psutil.Process(worker.pid)
        first = asyncio.create_task(worker.close())
        await asyncio.sleep(0)
        first.cancel()
        await worker.close()
        assert not process.is_running()  # a zombie runs
        await asyncio.gather(first, return_exceptions=True)


@pytest.mark.slow
async def test_questions_wait_for_each_other_and_the_wait_counts():
    async with running() as worker:
        await worker.start()
        first = asyncio.create_task(worker.ask(("sleep", 1.5), timeout_s=30))
        await asyncio.sleep(0.1)
        with pytest.raises(WorkerError, match="no answer within"):
            await worker.ask("impatient", timeout_s=0.2)
        assert (await first)[2] == ("sleep", 1.5)


@pytest.mark.slow
def test_worker_ends_with_its_parent_during_a_question():
    owner = (
        "import asyncio\n"
        "from robomesh.files.worker import Worker\n"
        "async def main():\n"
        f"    worker = Worker({CHILD!r}, 'settings')\n"
        "    await worker.start()\n"
        "    print(worker.pid, flush=True)\n"
        "    await worker.ask(('say and sleep', 300), timeout_s=300)\n"
        "asyncio.run(main())\n"
    )
    # The worker shares its parent's standard error, so `communicate` waits for both processes to end.
    with subprocess.Popen([sys.executable, "-c", owner], stdout=PIPE, stderr=PIPE, text=True) as process:
        worker = psutil.Process(int(process.stdout.readline()))
        assert process.stderr.readline() == "asleep\n"
        process.kill()
        try:
            process.communicate(timeout=40.0)
        finally:
            with contextlib.suppress(psutil.NoSuchProcess):
                worker.kill()


@pytest.mark.slow
async def test_timeout_error_of_a_handler_is_raised_and_the_process_goes_on():
    async with running() as worker:
        with pytest.raises(TimeoutError, match="the disk"):
            await worker.ask("time out", timeout_s=30)
        pid = worker.pid
        with pytest.raises(TimeoutError, match="the disk"):
            await worker.ask("time out", timeout_s=None)
        assert worker.pid == pid


@pytest.mark.slow
async def test_worker_that_was_killed_while_idle_has_no_pid_and_is_restarted():
    async with running() as worker:
        await worker.start()
        os.kill(worker.pid, signal.SIGKILL)
        async with asyncio.timeout(30):
            while worker.pid is not None:
                await asyncio.sleep(0.01)
        assert (await worker.ask("hello", timeout_s=30))[2] == "hello"


@pytest.mark.slow
async def test_worker_that_is_killed_during_a_question_crashes_and_is_restarted():
    async with running() as worker:
        await worker.start()
        asked = asyncio.create_task(worker.ask(("sleep", 60), timeout_s=60))
        await asyncio.sleep(0)
        os.kill(worker.pid, signal.SIGKILL)
        with pytest.raises(WorkerError, match=r"crashed \(status -9\)"):
            await asked
        assert (await worker.ask("hello", timeout_s=30))[2] == "hello"


@pytest.mark.slow
async def test_memory_limit_of_a_worker_is_an_error_of_its_handler():
    async with running(memory_bytes=1 << 30) as worker:
        pid = (await worker.ask(("allocate", 1 << 20), timeout_s=30))[1]
        with pytest.raises(MemoryError):
            await worker.ask(("allocate", 2 << 30), timeout_s=30)
        assert (await worker.ask("hello", timeout_s=30))[1] == pid


@pytest.mark.slow
async def test_reports_of_a_handler_arrive_in_order_before_the_answer():
    async with running() as worker:
        reports = []
        question = "report", [0.25, 0.5, 1.0]
        answer = await worker.ask(question, timeout_s=30, on_report=reports.append)
        assert (answer[2], reports) == (question, [0.25, 0.5, 1.0])


@pytest.mark.slow
async def test_untrusted_worker_answers_in_json_and_its_errors_are_texts():
    async with running(untrusted=True) as worker:
        assert (await worker.ask(("a", 1), timeout_s=30))[2] == ["a", 1]
        with pytest.raises(HandlerError, match="no such pose"):
            await worker.ask(("fail", "no such pose"), timeout_s=30)
        with pytest.raises(HandlerError, match="NotJson"):
            await worker.ask(NotJson(), timeout_s=30)
        assert (await worker.ask("hello", timeout_s=30))[2] == "hello"


class NotJson:
    pass


class Exploit:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (self.path, "w")


@pytest.mark.slow
async def test_untrusted_worker_cannot_run_code_in_its_parent_or_exhaust_its_memory(tmp_path):
    exploit = pickle.dumps(("answer", Exploit(str(tmp_path / "written"))))
    length = struct.Struct("<Q")
    async with running(untrusted=True) as worker:
        for data, problem in (
            (length.pack(len(exploit)) + exploit, "its answer is invalid"),
            (length.pack(1 << 40), "1099511627776 bytes"),
            (length.pack(4) + b"true", "its answer is invalid"),
        ):
            with pytest.raises(WorkerError, match=problem):
                await worker.ask(("send", data), timeout_s=30)
            assert worker.pid is None
        assert (await worker.ask("hello", timeout_s=30))[2] == "hello"
    assert list(tmp_path.iterdir()) == []
