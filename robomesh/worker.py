"""A process of one's own for work that takes long: asked one thing at a time, ended when it takes too long.

The process runs a module that calls `answer_all`; both ends speak pickles over its standard input and
output, so nobody else can ask it anything. One that hangs or dies is ended, and the next question starts
another.
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
    """No answer: it took too long, or the process ended over it."""


class Worker:
    """One worker process; one question at a time, the others wait for their turn.

    Args:
        module: Run by `python -m`; calls `answer_all`.
        settings: What its `begin` gets; pickled.
        nice: How far it steps back on a busy machine.
    """

    def __init__(self, module: str, settings: object, *, nice: int = 0) -> None:
        self._module = module
        self._settings = settings
        self._nice = nice
        self._turn = asyncio.Lock()
        self._process: asyncio.subprocess.Process | None = None

    @property
    def pid(self) -> int | None:
        """Of its process, while it has one."""
        return None if self._process is None else self._process.pid

    async def start(self) -> None:
        """Start the process, so that the first question need not wait for its imports.

        Raises:
            WorkerError: If it cannot begin; the text is what `begin` raised.
        """
        async with self._turn:
            await self._started()

    async def ask(self, question: object, *, timeout_s: float) -> Any:
        """The answer to a question; what its handler raises is raised here.

        Args:
            timeout_s: For the answer; waiting for one's turn counts, starting the process does not.

        Raises:
            WorkerError: If there is none.
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
        # Kept until it has ended: the wait may be cancelled, and then another caller of `close` waits.
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
                start_new_session=True,  # Ctrl-C is for its owner, who ends it
            )
        except OSError as error:
            raise WorkerError(f"{self._module} could not be started: {error.strerror}") from None
        try:
            async with asyncio.timeout(_START_S):
                await self._answer(process, self._settings)
        except TimeoutError:
            await self.close()
            raise WorkerError(f"{self._module} did not begin within {_START_S:g} s") from None
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
            raise WorkerError(f"{self._module} ended over it (status {process.returncode})") from None
        except BaseException:
            # Whoever asked is gone; the answer must not be taken for the next one's.
            await self.close()
            raise
        if raised:
            raise value
        return value


def answer_all(begin: Callable[[Any], Callable[[Any], Any]]) -> None:
    """The worker's end: answer each question until nobody asks any more, or its owner is killed.

    Args:
        begin: Gets the settings, gives what answers a question; exceptions of both go to who asks.
    """
    # In the middle of a question too: it holds its owner's log open, which tells that its owner has ended.
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    os.nice(int(sys.argv[1]))
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    questions, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    # What a library prints is no answer.
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
    """The next question; None: nobody asks any more."""
    head = questions.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        return None
    return pickle.loads(questions.read(*_LENGTH.unpack(head)))


def _write(answers: BinaryIO, raised: bool, value: object) -> None:
    try:
        body = pickle.dumps((raised, value))
        pickle.loads(body)  # an exception of several arguments may not come out of its pickle
    except Exception:
        body = pickle.dumps((True, RuntimeError(str(value))))
    answers.write(_LENGTH.pack(len(body)) + body)
    answers.flush()
