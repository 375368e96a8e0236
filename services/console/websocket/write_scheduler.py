"""Turns at serving the pages: what comes between two of them goes out together.

A write to a page costs much the same with one state in it as with ten (TLS, the system's call, the page's
own work). So with one page every state goes out as it comes, and the more pages there are, the more goes
out at once: a quarter of a processor is spent on it, until a display would show that pages wait.
"""

import asyncio
import logging
import time
from collections.abc import Callable

log = logging.getLogger(__name__)

# Of a processor's time, for turns; but none is longer than a display shows a picture.
_SHARE, _LONGEST_S = 0.25, 0.016
# A stop that a page asks for waits no longer for the other pages.
_LONGEST_AT_ONCE_S = 0.002


class Turns:
    """Who is to be served, and when."""

    def __init__(self) -> None:
        self._due: dict[Callable[[], None], None] = {}
        self._turn: asyncio.Task[None] | None = None

    def due(self, serve: Callable[[], None]) -> None:
        """Has a page served with the next turn; `serve` must return at once."""
        self._due[serve] = None
        if self._turn is None:
            self._turn = asyncio.create_task(self._serve())

    async def over(self) -> None:
        """Waits until what is due has been served, and for the rest after it."""
        if self._turn is not None:
            await asyncio.shield(self._turn)

    async def _serve(self) -> None:
        due, self._due = self._due, {}
        spent_s, began = 0.0, time.monotonic()
        used_s, at_once = time.thread_time(), began
        for serve in due:
            try:
                serve()
            except Exception:  # of one page: it must not take the others' turn
                log.exception("a page could not be served")
            if time.monotonic() - at_once > _LONGEST_AT_ONCE_S:
                spent_s += time.thread_time() - used_s
                await asyncio.sleep(0)
                used_s, at_once = time.thread_time(), time.monotonic()
        spent_s += time.thread_time() - used_s
        # On a busy machine the turn itself was rest enough.
        rest_s = min(spent_s / _SHARE, _LONGEST_S) - (time.monotonic() - began)
        await asyncio.sleep(max(rest_s, 0.0))
        self._turn = asyncio.create_task(self._serve()) if self._due else None
