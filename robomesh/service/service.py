"""Run a service: logs, signals, session, presence, and an exit within a time limit."""

import asyncio
import atexit
import contextlib
import copy
import logging
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Awaitable, Callable, Coroutine, Iterable
from typing import Any, TypeVar

from robomesh.service.health import Served, present
from robomesh.service.loop_turns import MeasuredLoop
from robomesh.texts import for_terminal
from robomesh.wire.session import Session, SessionSettings, open_session

AnySettings = TypeVar("AnySettings")

# A site ends within 2 s of Ctrl-C, even if a service hangs.
_EXIT_WITHIN_S = 1.7
# A service that writes files has more time, because half a recording or audit log is a fault.
WRITES_WITHIN_S = 10.0
_MOST_LINES = 2000
_FLUSH_WITHIN_S = 0.2


def run(
    serve: Callable[[Session, AnySettings], Awaitable[None]],
    settings: AnySettings,
    *,
    service: str,
    session_settings: SessionSettings,
    present_for: Iterable[tuple[str, str]],
    metrics: tuple[str, int] | None = None,
    ends_within_s: float = _EXIT_WITHIN_S,
) -> None:
    """Run a service of the mesh until SIGINT or SIGTERM.

    Args:
        serve: The service's coroutine; cancelled by the signal.
        service: Name in presence keys.
        present_for: The (site, robot) pairs that it serves; `-` as the robot for a whole site.
        metrics: Host and port of the Prometheus endpoint; None: no endpoint.
        ends_within_s: Time after the first signal at which the process exits in any case [s].
    """
    served = Served(service=service, present_for=tuple(present_for), metrics=metrics)

    async def serve_present() -> None:
        async with open_session(session_settings) as session, present(session, served):
            await serve(session, settings)

    run_until_signalled(serve_present(), ends_within_s=ends_within_s)


def run_until_signalled(main: Coroutine[Any, Any, None], *, ends_within_s: float = _EXIT_WITHIN_S) -> None:
    """Run a coroutine; SIGINT and SIGTERM cancel it, and the process exits when it has ended.

    A second SIGINT also cancels the coroutine's clean-up. A second SIGTERM is ignored, because both systemd
    and the supervisor send one to every process of a site.

    Args:
        ends_within_s: Time after the first signal at which the process exits with status 1 [s].
    """

    async def guarded() -> None:
        task = asyncio.ensure_future(main)
        loop = asyncio.get_running_loop()
        ending = False

        def end(number: signal.Signals) -> None:
            nonlocal ending
            if not ending:
                watchdog = threading.Timer(ends_within_s, os._exit, (1,))
                watchdog.daemon = True
                watchdog.start()
            elif number == signal.SIGTERM:
                return
            ending = True
            task.cancel()

        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, end, number)
        try:
            await task
        except asyncio.CancelledError:
            # Skip the interpreter's shutdown of threads and modules: it takes a second for each site on a
            # busy machine.
            _exit_now()

    with asyncio.Runner(loop_factory=MeasuredLoop) as runner:
        runner.run(guarded())


def _exit_now() -> None:
    for handler in logging.getLogger().handlers:
        if isinstance(handler, _Stderr):
            handler.flush_lines()
    if sys.stdout is not None:
        sys.stdout.flush()
    os._exit(0)


class _Stderr(logging.Handler):
    """A handler that passes lines to a writing thread, and drops lines while that thread is blocked.

    A blocked terminal (Ctrl-S, a full pipe) must not block a gateway or its exit.
    """

    def __init__(self) -> None:
        super().__init__()
        self.setFormatter(logging.Formatter("%(levelname)s %(message)s"))
        self.lines: queue.Queue[str] = queue.Queue(_MOST_LINES)
        threading.Thread(target=self._write, name="log", daemon=True).start()

    def emit(self, record: logging.LogRecord) -> None:
        # One line, whatever texts of others it holds; a traceback below it has several.
        line = copy.copy(record)
        line.msg, line.args = for_terminal(record.getMessage(), keep=""), None
        with contextlib.suppress(queue.Full):
            self.lines.put_nowait(for_terminal(self.format(line)))

    def flush_lines(self) -> None:
        """Wait briefly until all lines are written."""
        deadline = time.monotonic() + _FLUSH_WITHIN_S
        while self.lines.unfinished_tasks and time.monotonic() < deadline:
            time.sleep(0.005)

    def _write(self) -> None:
        while True:
            line = self.lines.get()
            with contextlib.suppress(OSError):
                os.write(2, f"{line}\n".encode(errors="replace"))
            self.lines.task_done()


def log_to_stderr(level: int = logging.INFO) -> None:
    """Log to standard error, one line for each record, written by a separate thread."""
    for number, name in ((logging.INFO, "info"), (logging.WARNING, "warning"), (logging.ERROR, "error")):
        logging.addLevelName(number, name)
    handler = _Stderr()
    logging.basicConfig(level=level, handlers=[handler], force=True)
    atexit.register(handler.flush_lines)
