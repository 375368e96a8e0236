"""Outbox: the messages of one iteration of the event loop, put one directly after the other.

A message that comes alone wakes Zenoh's sending thread, and the writing process waits for it to run. Messages
that follow each other within microseconds wake it once and leave together: ten cost half of the processor
time of ten that are 50 us apart.
"""

import asyncio

import zenoh
import zenoh.ext


class Outbox:
    """Messages that are put at the end of the running iteration of the event loop; for its thread only."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._waiting: list[tuple[zenoh.Publisher | zenoh.ext.AdvancedPublisher, bytes, bytes]] = []

    def add(
        self, publisher: zenoh.Publisher | zenoh.ext.AdvancedPublisher, payload: bytes, attachment: bytes
    ) -> None:
        """Put a message after those that were added before."""
        if not self._waiting:
            self._loop.call_soon(self.flush)
        self._waiting.append((publisher, payload, attachment))

    def flush(self) -> None:
        """Put what waits now."""
        waiting, self._waiting = self._waiting, []
        for publisher, payload, attachment in waiting:
            publisher.put(payload, attachment=attachment)
