"""A browser's connection that holds little back: what waits is in the lanes, where newer replaces older."""

import asyncio
from typing import Any, cast

from starlette.websockets import WebSocket
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

_MOST_WAITING = 16 * 1024
# In an ASGI message to a `Line`: what leaves before its bytes, in the same write.
_BEFORE = "robomesh.before"


async def send_together(websocket: WebSocket, messages: list[bytes]) -> None:
    """Several messages in one write: that is what most of a small one costs."""
    *before, last = messages
    await websocket.send({"type": "websocket.send", "bytes": last, _BEFORE: before})


class Line(WebSocketsSansIOProtocol):
    """uvicorn's WebSocket, told to wait earlier: its own 64 KiB are seconds of a slow line."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """As uvicorn does, with less of a buffer."""
        super().connection_made(transport)
        cast(asyncio.Transport, transport).set_write_buffer_limits(high=_MOST_WAITING)

    async def send(self, message: Any) -> None:
        """As uvicorn does, after what `send_together` gave beside it."""
        await self.writable.wait()
        if not (self.disconnected or self.close_sent):
            for each in message.get(_BEFORE, ()):
                self.conn.send_binary(each)
        await super().send(message)

    def data_received(self, data: bytes) -> None:
        """As uvicorn does, which forgets an upgrade that cannot be read: it would stay open for ever."""
        super().data_received(data)
        if self.conn.handshake_exc is not None and not self.handshake_initiated:
            self.transport.close()
