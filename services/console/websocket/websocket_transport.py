"""A browser's WebSocket with a small write buffer: samples wait in send queues, where newer replace older."""

import asyncio
from collections.abc import Callable
from typing import cast

from starlette.websockets import WebSocket
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

_MOST_WAITING = 16 * 1024
# Limits: unread answers to pings [bytes], and parts of an unfinished message.
_MAX_BUFFERED, _MOST_PARTS = 16 << 20, 1024
# Key among the extensions of the ASGI scope.
_LINE = "robomesh.line"


class WebSocketTransport(WebSocketsSansIOProtocol):
    """uvicorn's WebSocket with a small write buffer; uvicorn's own 64 KiB are seconds on a slow line.

    It writes shared frames directly: passing each message through ASGI costs ten times as much as the write.


    Attributes:
        on_ready: Called when the connection accepts data again.
    """

    on_ready: Callable[[], None] | None = None

    @property
    def ready(self) -> bool:
        """True if it accepts data now."""
        return self.writable.is_set() and self.open

    @property
    def open(self) -> bool:
        """True while data can still be sent."""
        return not (self.disconnected or self.close_sent or self.transport.is_closing())

    def write(self, frames: bytes) -> None:
        """Write whole WebSocket frames of whole messages; does nothing on a closed connection."""
        if self.open:
            self.transport.write(frames)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Set a smaller write buffer than uvicorn's."""
        super().connection_made(transport)
        cast(asyncio.Transport, transport).set_write_buffer_limits(high=_MOST_WAITING)

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
        """Put this connection into the scope, for `transport_of`."""
        self.scope["extensions"][_LINE] = {"line": self}
        await super().run_asgi()

    def data_received(self, data: bytes) -> None:
        """Close a failed upgrade, which uvicorn leaves open; limit pings' answers and parts of a message."""
        super().data_received(data)
        if self.conn.handshake_exc is not None and not self.handshake_initiated:
            self.transport.close()
        elif self.transport.get_write_buffer_size() > _MAX_BUFFERED or len(self.frames) > _MOST_PARTS:
            self.transport.abort()


def transport_of(websocket: WebSocket) -> WebSocketTransport:
    """Return the transport of a WebSocket."""
    return cast(WebSocketTransport, websocket.scope["extensions"][_LINE]["line"])
