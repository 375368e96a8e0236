"""The running of a service: logs, signals, session, presence, and an end that comes in time."""

import asyncio
import atexit
import contextlib
import logging
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Awaitable, Callable, Coroutine, Iterable
from typing import Any, TypeVar

from robomesh.health import Served, present
from robomesh.session import Session, SessionSettings, open_session
from robomesh.texts import for_terminal

AnySettings = TypeVar("AnySettings")

# A site is down within 2 s of Ctrl-C, whatever hangs.
_LAST_MOMENT_S = 1.7
# A service that must finish what it writes has longer: half a recording or audit log is a fault.
WRITES_WITHIN_S = 10.0
_MOST_LINES = 2000
_LAST_WORDS_S = 0.2


def run(
    serve: Callable[[Session, AnySettings], Awaitable[None]],
    settings: AnySettings,
    *,
    service: str,
    session_settings: SessionSettings,
    present_for: Iterable[tuple[str, str]],
    metrics: tuple[str, int] | None = None,
    ends_within_s: float = _LAST_MOMENT_S,
) -> None:
    """Run a service of the mesh until it is told to end.

    Args:
        serve: Its coroutine; cancelled by SIGINT and SIGTERM.
        service: Its name in presence keys.
        present_for: The (site, robot) pairs that it serves; `-` as the robot for a whole site.
        metrics: Host and port at which Prometheus may ask; None: nowhere.
        ends_within_s: From the first signal on; the process exits then, whatever it does.
    """
    served = Served(service=service, present_for=tuple(present_for), metrics=metrics)

    async def serve_present() -> None:
        async with open_session(session_settings) as session, present(session, served):
            await serve(session, settings)

    run_until_signalled(serve_present(), ends_within_s=ends_within_s)


def run_until_signalled(main: Coroutine[Any, Any, None], *, ends_within_s: float = _LAST_MOMENT_S) -> None:
    """Run a coroutine; SIGINT and SIGTERM cancel it, and the process exits when it has ended.

    A second SIGINT cancels its clean-up too. A second SIGTERM does not: systemd signals every process of a
    site, and then its supervisor does.

    Args:
        ends_within_s: From the first signal on; the process exits then with status 1.
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
            # Threads and modules have nothing to clean up any more: tearing them down costs a busy machine
            # a second a site.
            _exit_now()

    asyncio.run(guarded())


def _exit_now() -> None:
    for handler in logging.getLogger().handlers:
        if isinstance(handler, _Stderr):
            handler.last_words()
    sys.stdout.flush()
    os._exit(0)


class _Stderr(logging.Handler):
    """Hands lines to a writing thread, and drops them when that is held up.

    A terminal that is held (Ctrl-S, a full pipe) must hold neither a gateway nor its end.
    """

    def __init__(self) -> None:
        super().__init__()
        self.setFormatter(logging.Formatter("%(levelname)s %(message)s"))
        self.lines: queue.Queue[str] = queue.Queue(_MOST_LINES)
        threading.Thread(target=self._write, name="log", daemon=True).start()

    def emit(self, record: logging.LogRecord) -> None:
        with contextlib.suppress(queue.Full):
            self.lines.put_nowait(for_terminal(self.format(record)))

    def last_words(self) -> None:
        """Wait, briefly, until the lines are written."""
        deadline = time.monotonic() + _LAST_WORDS_S
        while self.lines.unfinished_tasks and time.monotonic() < deadline:
            time.sleep(0.005)

    def _write(self) -> None:
        while True:
            line = self.lines.get()
            with contextlib.suppress(OSError):
                os.write(2, f"{line}\n".encode(errors="replace"))
            self.lines.task_done()


def log_to_stderr(level: int = logging.INFO) -> None:
    """One line a record on standard error, in words, written by a thread of its own."""
    for number, name in ((logging.INFO, "info"), (logging.WARNING, "warning"), (logging.ERROR, "error")):
        logging.addLevelName(number, name)
    handler = _Stderr()
    logging.basicConfig(level=level, handlers=[handler], force=True)
    atexit.register(handler.last_words)
