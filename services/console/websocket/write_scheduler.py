"""Scheduling of writes to pages: samples that arrive between two rounds are written together.

A write costs about the same for one state as for ten (TLS, system call, the page's own work). With one page
every state is written as it arrives; with more pages, more states share a write. The rounds use a quarter of
a processor, as long as no page waits longer than a display's frame.
"""

import asyncio
import logging
import time
from collections.abc import Callable

log = logging.getLogger(__name__)

# Share of a processor for the rounds; the pause between rounds is at most one frame of a display.
_SHARE, _LONGEST_S = 0.25, 0.016
# Yield to the event loop this often, so that other pages do not delay a page's stop request.
_LONGEST_AT_ONCE_S = 0.002


class WriteScheduler:
    """Pages that wait to be served, and the task that serves them."""

    def __init__(self) -> None:
        self._due: dict[Callable[[], None], None] = {}
        self._turn: asyncio.Task[None] | None = None

    def schedule(self, serve: Callable[[], None]) -> None:
        """Serve a page in the next round; `serve` must not block."""
        self._due[serve] = None
        if self._turn is None:
            self._turn = asyncio.create_task(self._serve())

    async def wait_for_round(self) -> None:
        """Wait until this round and its pause are over."""
        if self._turn is not None:
            await asyncio.shield(self._turn)

    async def _serve(self) -> None:
        due, self._due = self._due, {}
        spent_s, began = 0.0, time.monotonic()
        used_s, at_once = time.thread_time(), began
        for serve in due:
            try:
                serve()
            except Exception:  # an error of one page must not affect the others
                log.exception("a page could not be served")
            if time.monotonic() - at_once > _LONGEST_AT_ONCE_S:
                spent_s += time.thread_time() - used_s
                await asyncio.sleep(0)
                used_s, at_once = time.thread_time(), time.monotonic()
        spent_s += time.thread_time() - used_s
        # On a busy machine the round itself was pause enough.
        rest_s = min(spent_s / _SHARE, _LONGEST_S) - (time.monotonic() - began)
        await asyncio.sleep(max(rest_s, 0.0))
        self._turn = asyncio.create_task(self._serve()) if self._due else None
