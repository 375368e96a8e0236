"""HTTP connections with a time limit for each request.

uvicorn waits for the end of a request without a limit, so a few hundred slow requests would exhaust the
console's file descriptors.
"""

import asyncio
import logging
from typing import cast

from uvicorn.protocols.http.h11_impl import H11Protocol

log = logging.getLogger(__name__)

# Time for a whole request, plus a second for this many of its bytes.
_REQUEST_TIMEOUT_S = 10.0
_LEAST_BYTES_PER_S = 1024
_CHECK_EVERY_S = 1.0


class Connection(H11Protocol):
    """uvicorn's HTTP connection; closes if a request stays incomplete for too long."""

    request_timeout_s = _REQUEST_TIMEOUT_S

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin to wait for a request."""
        super().connection_made(cast(asyncio.Transport, transport))
        self._request_began: float | None = self.loop.time()
        self._bytes = 0
        self._schedule_check()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the timer."""
        self._timer.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Count the bytes of an incomplete request."""
        if self._request_began is None:
            self._request_began, self._bytes = self.loop.time(), 0
        self._bytes += len(data)
        super().data_received(data)
        # h11 states: IDLE is an incomplete head, SEND_BODY an incomplete body.
        if str(self.conn.their_state) not in ("IDLE", "SEND_BODY"):
            self._request_began = None

    def _schedule_check(self) -> None:
        self._timer = self.loop.call_later(min(_CHECK_EVERY_S, self.request_timeout_s / 2), self._check)

    def _check(self) -> None:
        if self.transport.is_closing() or self.transport.get_protocol() is not self:
            return  # closed, or upgraded to a WebSocket
        if self._request_began is not None and not self.flow.read_paused:
            within_s = self.request_timeout_s + self._bytes / _LEAST_BYTES_PER_S
            if self.loop.time() - self._request_began > within_s:
                log.info("%s: an incomplete request timed out", self.client and self.client[0])
                self.transport.abort()
                return
        self._schedule_check()
