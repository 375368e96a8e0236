"""An event loop in its own thread, for callers that block."""

import asyncio
import atexit
import contextlib
import os
import signal
import threading
import weakref
from collections.abc import Callable, Coroutine
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, TypeVar

from robomesh.errors import RobomeshError, SessionError
from robomesh.files.forked import check_owner

T = TypeVar("T")

# How often a waiting caller shows that it is alive, and the loop looks for the end of the main thread.
_POLL_S = 0.2
# How long an interrupted caller waits until its coroutine has cleaned up, for example sent a stop.
_CLEANUP_S = 5.0


class _ThreadForEach(ThreadPoolExecutor):
    """An executor with a thread for each call: Python's accepts none when the main thread has ended."""

    def submit(self, call: Callable[..., T], /, *arguments: Any, **options: Any) -> "Future[T]":
        future: Future[T] = Future()

        def run() -> None:
            if not future.set_running_or_notify_cancel():
                return
            try:
                future.set_result(call(*arguments, **options))
            except BaseException as error:
                future.set_exception(error)

        threading.Thread(target=run).start()
        return future


class EventLoopThread:
    """An event loop that runs in its own thread.

    It runs until `close`, until the main thread ends, or until this object is no longer used: all objects of
    a connection share it.
    """

    def __init__(self) -> None:
        self._running = _Running()
        weakref.finalize(self, self._running.stop).atexit = False

    def at_end(self, close: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Set what runs before the loop ends."""
        self._running.closing = close

    def run(self, coroutine: Coroutine[Any, Any, T], *, waiting: Callable[[], None] = lambda: None) -> T:
        """Run a coroutine to its end and return its result; for any thread but the loop's own.

        If the caller is interrupted, the coroutine is cancelled, and the interruption is raised when it has
        ended.

        Args:
            waiting: Called several times a second by the waiting thread.

        Raises:
            SessionError: If the loop has been closed, or is closed before the coroutine ends.
            ForkedError: In a process that was forked from the loop's.
        """
        return self._running.run(coroutine, waiting)

    def close(self) -> None:
        """Run what was set by `at_end`, and end the thread."""
        self._running.close()


class _Running:
    """The loop and its thread, which refers to this object until it ends.

    The thread is not a daemon: Python ends daemon threads inside Zenoh's code, which aborts the process.
    """

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._loop.set_default_executor(_ThreadForEach())
        self.closing: Callable[[], Coroutine[Any, Any, None]] | None = None
        self._stopping = asyncio.Event()
        self._ended = False
        self._pid = os.getpid()
        # Not `Thread.join`: a Ctrl-C at Python's exit may leave a thread's lock locked.
        self._finished = threading.Event()
        self._thread = threading.Thread(target=self._run, name="robomesh")
        self._thread.start()
        # An interrupted exit does not wait for threads, and ends Python inside Zenoh's code.
        atexit.register(self._close_at_exit)

    def run(self, coroutine: Coroutine[Any, Any, T], waiting: Callable[[], None]) -> T:
        """See `EventLoopThread.run`."""
        if self._has_ended():
            coroutine.close()
            check_owner(self._pid)
            raise _closed()
        result: Future[T] = Future()
        tasks: list[asyncio.Task[T]] = []

        def start() -> None:
            if self._ended:
                coroutine.close()
                result.set_exception(_closed())
                return
            tasks.append(self._loop.create_task(coroutine))
            tasks[0].add_done_callback(lambda task: _transfer(task, result))

        def cancel() -> None:
            for task in tasks:
                task.cancel()

        try:
            self._loop.call_soon_threadsafe(start)
            while True:
                waiting()
                with contextlib.suppress(TimeoutError):
                    return result.result(timeout=_POLL_S)
                if result.done():  # the coroutine itself timed out
                    return result.result()
                if not self._thread.is_alive():  # it ended before it started the coroutine
                    coroutine.close()
                    raise _closed()
        except BaseException as error:
            if not result.done() and self._thread.is_alive():
                with contextlib.suppress(RuntimeError):  # the loop has just ended
                    self._loop.call_soon_threadsafe(cancel)
                with contextlib.suppress(Exception):
                    result.exception(timeout=_CLEANUP_S)
            if self._has_ended() and isinstance(error, Exception) and not isinstance(error, RobomeshError):
                raise _closed() from None
            raise

    def stop(self) -> None:
        """Let the thread end soon."""
        with contextlib.suppress(RuntimeError):  # the loop has just ended
            self._loop.call_soon_threadsafe(self._stopping.set)

    def close(self) -> None:
        """Stop, and wait for the thread's end."""
        if self._thread.is_alive():
            self.stop()
            self._finished.wait()

    def _has_ended(self) -> bool:
        return self._ended or not self._thread.is_alive()

    def _close_at_exit(self) -> None:
        handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            self.close()
        finally:
            signal.signal(signal.SIGINT, handler)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._run_until_stopped())
        finally:
            self._loop.close()
            atexit.unregister(self._close_at_exit)
            self._finished.set()

    async def _run_until_stopped(self) -> None:
        while threading.main_thread().is_alive() and not self._stopping.is_set():
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_POLL_S):
                    await self._stopping.wait()
        self._ended = True
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)
        if self.closing is not None:
            await self.closing()


def _transfer(task: asyncio.Task[T], result: "Future[T]") -> None:
    if task.cancelled():
        result.cancel()
        result.set_running_or_notify_cancel()
    elif (error := task.exception()) is not None:
        result.set_exception(error)
    else:
        result.set_result(task.result())


def _closed() -> SessionError:
    return SessionError("the connection is closed: call robomesh.connect() again")
