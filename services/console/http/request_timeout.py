"""Connections of strangers: a request is whole in time.

uvicorn waits for ever for the end of one; a few hundred slow ones would take a console's files from
everybody else.
"""

import asyncio
import logging
from typing import cast

from uvicorn.protocols.http.h11_impl import H11Protocol

log = logging.getLogger(__name__)

# A request is whole within so long, and a second more for each so many bytes of it.
_WHOLE_WITHIN_S = 10.0
_LEAST_BYTES_PER_S = 1024
_LOOK_EACH_S = 1.0


class Connection(H11Protocol):
    """uvicorn's HTTP connection, closed where a request does not come to its end."""

    whole_within_s = _WHOLE_WITHIN_S

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """As uvicorn does; from now on a request is awaited."""
        super().connection_made(cast(asyncio.Transport, transport))
        self._begun: float | None = self.loop.time()
        self._bytes = 0
        self._look_in()

    def connection_lost(self, exc: Exception | None) -> None:
        """As uvicorn does."""
        self._timer.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """As uvicorn does, counting what came of a request that is not whole."""
        if self._begun is None:
            self._begun, self._bytes = self.loop.time(), 0
        self._bytes += len(data)
        super().data_received(data)
        # h11's: IDLE is a head that has not ended, SEND_BODY a body that has not.
        if str(self.conn.their_state) not in ("IDLE", "SEND_BODY"):
            self._begun = None

    def _look_in(self) -> None:
        self._timer = self.loop.call_later(min(_LOOK_EACH_S, self.whole_within_s / 2), self._look)

    def _look(self) -> None:
        if self.transport.is_closing() or self.transport.get_protocol() is not self:
            return  # it is gone, or a WebSocket
        if self._begun is not None and not self.flow.read_paused:
            within_s = self.whole_within_s + self._bytes / _LEAST_BYTES_PER_S
            if self.loop.time() - self._begun > within_s:
                log.info("%s: a request did not come to its end: cut off", self.client and self.client[0])
                self.transport.abort()
                return
        self._look_in()
