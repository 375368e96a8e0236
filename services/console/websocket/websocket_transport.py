"""A browser's WebSocket with a small write buffer: samples wait in send queues, where newer replace older.

It is read in small pieces, as fast as the page's allowance permits; see `read_scheduler`.
"""

import asyncio
import math
from collections.abc import Callable
from typing import Any, cast

from starlette.websockets import WebSocket
from uvicorn._types import ASGIReceiveEvent
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from robomesh import reason_codes as codes
from services.console.common.errors import WatchError
from services.console.common.read_scheduler import READS, Allowance, ReadScheduler

_MOST_WAITING = 16 * 1024
# Limits: unread answers to pings [bytes], and parts of an unfinished message.
_MAX_BUFFERED, _MOST_PARTS = 16 << 20, 1024
# Read in one turn of the event loop [bytes]: at most 86 frames, which take less than a millisecond.
_PIECE = 512
# Costs, compared with a message: bytes that cost as much, and a connection.
_BYTES_OF_COST, _CONNECTION_COST = 8192.0, 20.0
# A page that asks too much for so long is disconnected.
_PATIENCE_S = 10.0
# Time for a browser to answer a close frame; what it sends in it is discarded.
_CLOSED_WITHIN_S = 1.0
# Queued for `receive` behind the messages that were read before.
_CUT_OFF: ASGIReceiveEvent = {"type": "websocket.disconnect", "code": 1008, "reason": None}
# Key among the extensions of the ASGI scope.
_LINE = "robomesh.line"


class WebSocketTransport(WebSocketsSansIOProtocol):
    """uvicorn's WebSocket with a small write buffer; uvicorn's own 64 KiB are seconds on a slow line.

    It writes shared frames directly: passing each message through ASGI costs ten times as much as the write.

    Attributes:
        on_ready: Called when the connection accepts data again.
    """

    on_ready: Callable[[], None] | None = None

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.close_timeout = _CLOSED_WITHIN_S
        self._reads: ReadScheduler = self.app_state[READS]
        self._queue = self._reads.pages
        self._allowances: tuple[Allowance, ...] = ()
        self._unread = bytearray()
        # The next piece is scheduled, or waits for the allowance.
        self._piece_due = False
        # Since when it asks too much; it rests when all is read and its allowance is full.
        self._excess_since = math.inf
        self._all_read = True
        self._cut_off = False

    @property
    def ready(self) -> bool:
        """True if it accepts data now."""
        return self.writable.is_set() and self.open

    @property
    def open(self) -> bool:
        """True while data can still be sent."""
        return not (self.disconnected or self.close_sent or self.transport.is_closing())

    async def limit(self, asker: str, *, stops: bool = False) -> None:
        """Read no faster than the allowances of this page and of its asker permit; wait for the asker's.

        Args:
            asker: The account; without accounts the address.
            stops: This connection carries stops only.
        """
        self._allowances = self._reads.allowances(asker, stops=stops)
        self._queue = self._reads.stops if stops else self._reads.pages
        self.spend(_CONNECTION_COST)
        await asyncio.sleep(self._wait_s())

    def spend(self, cost: float) -> None:
        """Charge the page for work that a message caused; a message itself costs 1."""
        now = self.loop.time()
        for each in self._allowances:
            each.spend(cost, now)

    def write(self, frames: bytes) -> None:
        """Write whole WebSocket frames of whole messages; does nothing on a closed connection."""
        if self.open:
            self.transport.write(frames)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Set a smaller write buffer than uvicorn's."""
        super().connection_made(cast(asyncio.Transport, _ClosedOnce(transport)))
        cast(asyncio.Transport, transport).set_write_buffer_limits(high=_MOST_WAITING)

    def connection_lost(self, exc: Exception | None) -> None:
        """Discard unread data."""
        self._unread.clear()
        super().connection_lost(exc)

    def resume_writing(self) -> None:
        """Notify the connection's writer, too."""
        super().resume_writing()
        if self.on_ready is not None:
            self.on_ready()

    def keepalive_timeout(self) -> None:
        """Abort the connection; uvicorn would wait until all unread data is read."""
        super().keepalive_timeout()
        self.transport.abort()

    async def run_asgi(self) -> None:
        """Put this connection into the scope, for `transport_of`; abort it if it does not end soon."""
        self.scope["extensions"][_LINE] = {"line": self}
        await super().run_asgi()
        self.loop.call_later(_CLOSED_WITHIN_S, self.transport.abort)

    def data_received(self, data: bytes) -> None:
        """Keep data until it is read in pieces, and take no more before that."""
        if not self._cut_off:
            self._unread += data
            self.transport.pause_reading()
            self._schedule_piece()

    async def receive(self) -> ASGIReceiveEvent:
        """Return the next message; as uvicorn does, read further only when the page's messages are handled.

        Raises:
            WatchError: If the page asks too much.
        """
        message = await self.queue.get()
        if message is _CUT_OFF:
            raise WatchError(codes.PAGE_ASKS_TOO_MUCH(seconds=_PATIENCE_S))
        if self.read_paused and self.queue.empty():
            self.read_paused = False
            self._schedule_piece()
        return message

    def handle_events(self) -> None:
        """Charge the page for all its frames, pings and parts of messages too."""
        self.spend(len(self.conn.events))
        super().handle_events()

    def _wait_s(self) -> float:
        now = self.loop.time()
        return max((each.wait_s(now) for each in self._allowances), default=0.0)

    def _schedule_piece(self) -> None:
        if self._piece_due or self.read_paused or self._cut_off:
            return
        if not self._unread:
            self._all_read = True
            self.transport.resume_reading()
            return
        wait_s = self._wait_s()
        if wait_s:
            now = self.loop.time()
            if self._all_read and self._allowances[0].is_full(now):
                self._excess_since = math.inf
            self._all_read = False
            self._excess_since = min(self._excess_since, now)
            if now - self._excess_since > _PATIENCE_S:
                self._cut_off = True
                self._unread.clear()
                self.queue.put_nowait(_CUT_OFF)
                return
        self._piece_due = True
        if wait_s:
            self.loop.call_later(wait_s, self._reads.turns.add, self._queue, self._read_piece)
        else:
            self._reads.turns.add(self._queue, self._read_piece)

    def _read_piece(self) -> None:
        """Read a piece; close a failed upgrade, which uvicorn leaves open; limit parts of a message."""
        self._piece_due = False
        piece = bytes(self._unread[:_PIECE])
        del self._unread[:_PIECE]
        if not piece or self.disconnected:
            return
        self.spend(len(piece) / _BYTES_OF_COST)
        super().data_received(piece)
        if self.conn.handshake_exc is not None and not self.handshake_initiated:
            self.transport.close()
        elif self.transport.get_write_buffer_size() > _MAX_BUFFERED or len(self.frames) > _MOST_PARTS:
            self.transport.abort()
        elif self.transport.is_closing():
            # asyncio's close() does nothing to a TLS connection that ended while its reading was paused.
            self.transport.resume_reading()
        else:
            self._schedule_piece()


class _ClosedOnce:
    """A transport whose second close does nothing.

    uvicorn closes it twice, and asyncio's transport for TLS forgets its protocol at the second close: it can
    neither read nor end any more.
    """

    def __init__(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport

    def __getattr__(self, name: str) -> object:
        return getattr(self._transport, name)

    def close(self) -> None:
        if not self._transport.is_closing():
            self._transport.close()


def transport_of(websocket: WebSocket) -> WebSocketTransport:
    """Return the transport of a WebSocket."""
    return cast(WebSocketTransport, websocket.scope["extensions"][_LINE]["line"])
