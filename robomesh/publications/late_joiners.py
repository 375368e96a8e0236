"""The thread that answers the queries of late joiners, one for all publishers of a session.

By default zenoh-python starts a thread for each callback: a renderer of eight robots had 200, and with nine
robots more threads than a container may have.
"""

import logging
import threading
from collections.abc import Callable
from queue import Queue

import zenoh

log = logging.getLogger(__name__)

# As many as Zenoh's own queue in front of a callback.
_MOST_WAITING = 256


class AnsweringThread:
    """A thread that runs answers in order; it starts with the first one."""

    def __init__(self) -> None:
        self._waiting: Queue[Callable[[], None] | None] = Queue(_MOST_WAITING)
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()
        self._closed = False

    def add(self, answer: Callable[[], None]) -> None:
        """Run an answer after those that wait; block while too many wait. On any thread.

        Zenoh does not read the connection while its thread is blocked, so that a flood waits at its sender.
        """
        with self._lock:
            if self._closed:
                return
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="answers", daemon=True)
                self._thread.start()
        self._waiting.put(answer)

    def close(self) -> None:
        """Run the answers that wait, and end the thread."""
        with self._lock:
            self._closed = True
        if self._thread is not None:
            self._waiting.put(None)
            self._thread.join()

    def _run(self) -> None:
        while (answer := self._waiting.get()) is not None:
            try:
                answer()
            except zenoh.ZError as error:
                log.debug("a late joiner got no answer: %s", error)
            except Exception:
                log.exception("a late joiner could not be answered")
