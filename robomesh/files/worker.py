"""Worker processes for long computations and untrusted files: one question at a time, killed on timeout.

The process runs a module that calls `answer_all`. Messages pass over its standard input and output, so no
other process can reach it: a length (uint64, little-endian), then a body. A question is a pickle; an answer
is a kind and a value, as a pickle or, from an untrusted worker, as JSON. The first question is the settings.
"""

import asyncio
import contextlib
import ctypes
import json
import os
import pickle
import resource
import signal
import struct
import sys
from collections.abc import Callable, Iterator
from typing import Any, BinaryIO

from robomesh import bounded_json
from robomesh import reason_codes as codes
from robomesh.errors import CodedError, RobomeshError
from robomesh.files.memory_limit import MEMORY_BYTES, limit_memory

_START_S = 60.0
_LENGTH = struct.Struct("<Q")
_MOST_UNTRUSTED_BYTES = 64 * 1024**2
_PR_SET_PDEATHSIG = 1
# Kinds of answers.
_ANSWER, _ERROR, _REPORT = "answer", "error", "report"


class WorkerError(CodedError):
    """No answer: timeout, or the process did not start or crashed while handling the question."""


class WorkerTimeoutError(WorkerError):
    """No answer in time; the process was killed."""


class HandlerError(RobomeshError):
    """An error of an untrusted worker's handler; the text is that of its exception."""


class Worker:
    """One worker process; answers one question at a time, other callers wait.

    Args:
        module: Module for `python -m`; calls `answer_all`.
        settings: Argument of the module's `begin`; pickled.
        nice: Niceness of the process.
        memory_bytes: Memory limit of the process.
        untrusted: A file that it reads may take over the process. Its answers are JSON and limited in size,
            because a pickle could run code in this process.
    """

    def __init__(
        self,
        module: str,
        settings: object,
        *,
        nice: int = 0,
        memory_bytes: int = MEMORY_BYTES,
        untrusted: bool = False,
    ) -> None:
        self._module = module
        self._settings = settings
        self._nice = nice
        self._memory_bytes = memory_bytes
        self._untrusted = untrusted
        self._turn = asyncio.Lock()
        self._process: asyncio.subprocess.Process | None = None

    @property
    def pid(self) -> int | None:
        """Process id; None: no process is running."""
        return None if self._process is None or self._process.returncode is not None else self._process.pid

    async def start(self) -> None:
        """Start the process, so that the first question does not wait for its imports.

        Raises:
            WorkerError: If it cannot start; the text is that of the error in `begin`.
        """
        async with self._turn:
            await self._started()

    async def ask(
        self,
        question: object,
        *,
        timeout_s: float | None,
        on_report: Callable[[Any], None] = lambda _: None,
    ) -> Any:
        """Return the answer to a question; raise the handler's exception.

        Args:
            timeout_s: Time for the answer [s]; includes the wait for other callers, but not the start of
                the process. None: no limit.
            on_report: Called with each value that the handler passes to `report`.

        Raises:
            WorkerTimeoutError: If no answer arrived in time.
            WorkerError: If the process did not start or crashed, or its answer is invalid.
            HandlerError: If the handler of an untrusted worker raised an exception.
        """
        deadline = asyncio.timeout(timeout_s)
        clock = asyncio.get_running_loop().time
        try:
            async with deadline, self._turn:
                until, begun = deadline.when(), clock()
                deadline.reschedule(None)
                process = await self._started()
                deadline.reschedule(None if until is None else until + clock() - begun)
                return await self._answer(process, question, on_report)
        except TimeoutError:
            if not deadline.expired():
                raise  # an exception of the handler
            raise WorkerTimeoutError(codes.WORKER_TOO_SLOW(seconds=timeout_s)) from None

    async def close(self) -> None:
        """End the process and its children."""
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
            numbers = self._nice, os.getpid(), self._memory_bytes, int(self._untrusted)
            self._process = process = await asyncio.create_subprocess_exec(
                sys.executable,
                "-P",
                "-m",
                self._module,
                *map(str, numbers),
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
                start_new_session=True,  # for `killpg`; Ctrl-C must reach only the parent
            )
        except OSError as error:
            reason = codes.WORKER_NOT_STARTED(module=self._module, detail=error.strerror)
            raise WorkerError(reason) from None
        try:
            async with asyncio.timeout(_START_S):
                await self._answer(process, self._settings)
        except TimeoutError:
            await self.close()
            reason = codes.WORKER_START_TOO_SLOW(module=self._module, seconds=_START_S)
            raise WorkerError(reason) from None
        except WorkerError:
            raise
        except Exception as error:
            await self.close()
            raise WorkerError(str(error) or type(error).__name__) from error
        return process

    async def _answer(
        self,
        process: asyncio.subprocess.Process,
        question: object,
        on_report: Callable[[Any], None] = lambda _: None,
    ) -> Any:
        assert process.stdin is not None
        assert process.stdout is not None
        body = pickle.dumps(question)
        try:
            process.stdin.write(_LENGTH.pack(len(body)) + body)
            await process.stdin.drain()
            kind, value = await self._receive(process.stdout)
            while kind == _REPORT:
                on_report(value)
                kind, value = await self._receive(process.stdout)
        except (asyncio.IncompleteReadError, ConnectionError):
            await self.close()
            reason = codes.WORKER_CRASHED(module=self._module, status=process.returncode)
            raise WorkerError(reason) from None
        except BaseException:
            # The caller was cancelled, or the answer is invalid; the next caller must not receive the rest.
            await self.close()
            raise
        if kind == _ERROR:
            raise HandlerError(value) if self._untrusted else value
        return value

    async def _receive(self, answers: asyncio.StreamReader) -> tuple[str, Any]:
        (length,) = _LENGTH.unpack(await answers.readexactly(_LENGTH.size))
        if self._untrusted and length > _MOST_UNTRUSTED_BYTES:
            reason = codes.WORKER_ANSWER_TOO_LONG(
                module=self._module, count=length, most=_MOST_UNTRUSTED_BYTES
            )
            raise WorkerError(reason)
        body = await answers.readexactly(length)
        try:
            kind, value = bounded_json.loads(body) if self._untrusted else pickle.loads(body)
        except (ValueError, TypeError, RecursionError) as error:
            raise WorkerError(codes.WORKER_ANSWER_INVALID(module=self._module, detail=error)) from None
        return kind, value


def answer_all(begin: Callable[[Any], Callable[[Any], Any]]) -> None:
    """Run the worker's side: answer questions until the input is closed or the parent dies.

    Args:
        begin: Takes the settings and returns the handler of questions; exceptions of both go to the caller.
    """
    nice, parent, memory_bytes, untrusted = map(int, sys.argv[1:])
    # Also in the middle of a question: an open copy of the parent's log would hide that the parent ended.
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        return  # it ended before that call
    os.nice(nice)
    limit_memory(memory_bytes)
    # Writing a dump of gigabytes would delay the restart.
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    global _answers
    _answers = _Answers(os.fdopen(os.dup(1), "wb"), bool(untrusted))
    # Redirect the output of libraries, which is not an answer.
    os.dup2(2, 1)
    handler: Callable[[Any], Any] | None = None
    for question in _questions(os.fdopen(os.dup(0), "rb")):
        try:
            if handler is None:
                handler = begin(question)
                _answers.send(_ANSWER, None)
            else:
                _answers.send(_ANSWER, handler(question))
        except Exception as error:
            _answers.send(_ERROR, error)


def report(value: object) -> None:
    """Send a value to the `on_report` of the caller, while a handler runs."""
    assert _answers is not None, "`answer_all` calls the handlers"
    _answers.send(_REPORT, value)


class _Answers:
    """The worker's output."""

    def __init__(self, stream: BinaryIO, as_json: bool) -> None:
        self._stream = stream
        self._as_json = as_json

    def send(self, kind: str, value: object) -> None:
        try:
            body = self._encode(kind, value)
        except Exception:
            body = self._encode(_ERROR, RuntimeError(str(value)))
        self._stream.write(_LENGTH.pack(len(body)) + body)
        self._stream.flush()

    def _encode(self, kind: str, value: object) -> bytes:
        if self._as_json:
            if kind == _ERROR:
                value = str(value) or type(value).__name__
            return json.dumps((kind, value)).encode()
        body = pickle.dumps((kind, value))
        if kind == _ERROR:
            pickle.loads(body)  # an exception with several arguments may fail to unpickle
        return body


_answers: _Answers | None = None


def _questions(stream: BinaryIO) -> Iterator[Any]:
    while len(head := stream.read(_LENGTH.size)) == _LENGTH.size:
        yield pickle.loads(stream.read(*_LENGTH.unpack(head)))
