"""A worker process for long computations: one question at a time, killed on timeout.

The process runs a module that calls `answer_all`. Both ends exchange pickles over its standard input and
output, so no other process can reach it. A worker that hangs is killed; the next question starts a new one.
"""

import asyncio
import contextlib
import ctypes
import os
import pickle
import resource
import signal
import struct
import sys
from collections.abc import Callable
from typing import Any, BinaryIO

from robomesh.errors import BusError

_START_S = 60.0
_LENGTH = struct.Struct("<Q")
_MEMORY_BYTES = 6 * 1024**3
_PR_SET_PDEATHSIG = 1


class WorkerError(BusError):
    """No answer: timeout, or the process crashed while handling the question."""


class Worker:
    """One worker process; answers one question at a time, other callers wait.

    Args:
        module: Module for `python -m`; calls `answer_all`.
        settings: Argument of the module's `begin`; pickled.
        nice: Niceness of the process.
    """

    def __init__(self, module: str, settings: object, *, nice: int = 0) -> None:
        self._module = module
        self._settings = settings
        self._nice = nice
        self._turn = asyncio.Lock()
        self._process: asyncio.subprocess.Process | None = None

    @property
    def pid(self) -> int | None:
        """Process id; None: no process is running."""
        return None if self._process is None else self._process.pid

    async def start(self) -> None:
        """Start the process, so that the first question does not wait for its imports.

        Raises:
            WorkerError: If it cannot start; the text is that of the error in `begin`.
        """
        async with self._turn:
            await self._started()

    async def ask(self, question: object, *, timeout_s: float) -> Any:
        """Return the answer to a question; raise the handler's exception.

        Args:
            timeout_s: Time for the answer [s]; includes the wait for other callers, but not the start of
                the process.

        Raises:
            WorkerError: If no answer arrived in time, or the process crashed.
        """
        try:
            async with asyncio.timeout(timeout_s) as deadline:
                async with self._turn:
                    left_s = (deadline.when() or 0.0) - asyncio.get_running_loop().time()
                    deadline.reschedule(None)
                    process = await self._started()
                    deadline.reschedule(asyncio.get_running_loop().time() + left_s)
                    return await self._answer(process, question)
        except TimeoutError:
            raise WorkerError(f"no answer within {timeout_s:g} s") from None

    async def close(self) -> None:
        """End the process."""
        process = self._process
        if process is None:
            return
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        # Keep the process until it has ended: if this wait is cancelled, another call of `close` can wait.
        await process.wait()
        if self._process is process:
            self._process = None

    async def _started(self) -> asyncio.subprocess.Process:
        if self._process is not None and self._process.returncode is None:
            return self._process
        try:
            self._process = process = await asyncio.create_subprocess_exec(
                sys.executable,
                "-m",
                self._module,
                str(self._nice),
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
                start_new_session=True,  # Ctrl-C must reach only the parent, which then ends the worker
            )
        except OSError as error:
            raise WorkerError(f"{self._module} could not be started: {error.strerror}") from None
        try:
            async with asyncio.timeout(_START_S):
                await self._answer(process, self._settings)
        except TimeoutError:
            await self.close()
            raise WorkerError(f"{self._module} did not start within {_START_S:g} s") from None
        except WorkerError:
            raise
        except Exception as error:
            await self.close()
            raise WorkerError(str(error)) from error
        return process

    async def _answer(self, process: asyncio.subprocess.Process, question: object) -> Any:
        assert process.stdin is not None
        assert process.stdout is not None
        body = pickle.dumps(question)
        try:
            process.stdin.write(_LENGTH.pack(len(body)) + body)
            await process.stdin.drain()
            (length,) = _LENGTH.unpack(await process.stdout.readexactly(_LENGTH.size))
            raised, value = pickle.loads(await process.stdout.readexactly(length))
        except (asyncio.IncompleteReadError, ConnectionError):
            await self.close()
            raise WorkerError(f"{self._module} crashed (status {process.returncode})") from None
        except BaseException:
            # The caller was cancelled; the next caller must not receive this answer.
            await self.close()
            raise
        if raised:
            raise value
        return value


def answer_all(begin: Callable[[Any], Callable[[Any], Any]]) -> None:
    """Run the worker's side: answer questions until the input is closed or the parent dies.

    Args:
        begin: Takes the settings and returns the handler of questions; exceptions of both go to the caller.
    """
    # Also in the middle of a question: an open copy of the parent's log would hide that the parent ended.
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    os.nice(int(sys.argv[1]))
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    questions, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    # Redirect the output of libraries, which is not an answer.
    os.dup2(2, 1)
    handler: Callable[[Any], Any] | None = None
    for question in iter(lambda: _read(questions), None):
        try:
            if handler is None:
                handler = begin(question)
                _write(answers, False, None)
            else:
                _write(answers, False, handler(question))
        except Exception as error:
            _write(answers, True, error)


def _read(questions: BinaryIO) -> Any:
    """Return the next question; None: the input is closed."""
    head = questions.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        return None
    return pickle.loads(questions.read(*_LENGTH.unpack(head)))


def _write(answers: BinaryIO, raised: bool, value: object) -> None:
    try:
        body = pickle.dumps((raised, value))
        pickle.loads(body)  # an exception with several arguments may fail to unpickle
    except Exception:
        body = pickle.dumps((True, RuntimeError(str(value))))
    answers.write(_LENGTH.pack(len(body)) + body)
    answers.flush()
