"""A browser's connection that holds little back: what waits is in the lanes, where newer replaces older."""

import asyncio
from collections.abc import Callable
from typing import cast

from starlette.websockets import WebSocket
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

_MOST_WAITING = 16 * 1024
# Answers to pings that nobody reads [bytes], and parts of a message without end: more, and it is cut off.
_MOST_HELD, _MOST_PARTS = 16 << 20, 1024
# Among the extensions of a WebSocket's ASGI scope.
_LINE = "robomesh.line"


class Line(WebSocketsSansIOProtocol):
    """uvicorn's WebSocket, told to wait earlier: its own 64 KiB are seconds of a slow line.

    And with a way past ASGI for frames that are the same for many: each message on its own through it
    costs ten times what it costs to write it.

    Attributes:
        on_ready: Called when it takes more again.
    """

    on_ready: Callable[[], None] | None = None

    @property
    def ready(self) -> bool:
        """Whether it takes more now."""
        return self.writable.is_set() and self.open

    @property
    def open(self) -> bool:
        """Whether anything can still be sent."""
        return not (self.disconnected or self.close_sent or self.transport.is_closing())

    def write(self, frames: bytes) -> None:
        """Sends whole WebSocket frames of whole messages; on a line that is no longer open, nothing."""
        if self.open:
            self.transport.write(frames)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """As uvicorn does, with less of a buffer."""
        super().connection_made(transport)
        cast(asyncio.Transport, transport).set_write_buffer_limits(high=_MOST_WAITING)

    def resume_writing(self) -> None:
        """As uvicorn does; and tells who serves the page."""
        super().resume_writing()
        if self.on_ready is not None:
            self.on_ready()

    def keepalive_timeout(self) -> None:
        """As uvicorn does, which would wait until all that is unread has been read."""
        super().keepalive_timeout()
        self.transport.abort()

    async def run_asgi(self) -> None:
        """As uvicorn does; the application finds this line with `line_of`."""
        self.scope["extensions"][_LINE] = {"line": self}
        await super().run_asgi()

    def data_received(self, data: bytes) -> None:
        """As uvicorn does, which forgets an upgrade that cannot be read (it would stay open for ever), and
        bounds neither the answers to pings nor the parts of a message.
        """
        super().data_received(data)
        if self.conn.handshake_exc is not None and not self.handshake_initiated:
            self.transport.close()
        elif self.transport.get_write_buffer_size() > _MOST_HELD or len(self.frames) > _MOST_PARTS:
            self.transport.abort()


def line_of(websocket: WebSocket) -> Line:
    """The connection under a WebSocket."""
    return cast(Line, websocket.scope["extensions"][_LINE]["line"])
