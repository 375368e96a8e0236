"""One client of the simulated controller: its unfinished unit, and how far it is behind."""

import asyncio
import socket
from typing import Protocol

from protocol_gateway.core.codes import CodeTable
from protocol_gateway.core.stream import StreamEvent, UnitStream

# Small, so that a client that does not read is noticed before it is given old states for minutes.
_SEND_BUFFER_BYTES = 16 * 1024
_ANSWERS_BYTES = 64 * 1024
_PATIENCE_S = 5.0


class Server(Protocol):
    """What a client needs of its server."""

    def joined(self, client: "Client") -> None:
        """A client has come."""
        ...

    def left(self, client: "Client") -> None:
        """It has gone."""
        ...

    def heard(self, client: "Client", events: list[StreamEvent]) -> None:
        """It sent units, or what should have been some."""
        ...


class Client(asyncio.Protocol):
    """A client's connection."""

    _transport: asyncio.Transport

    def __init__(self, server: Server, table: CodeTable) -> None:
        self._server = server
        self._stream = UnitStream(table)
        self._behind_since_s: float | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Called by asyncio: the connection stands."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        connection: socket.socket = transport.get_extra_info("socket")
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
        self._server.joined(self)

    def connection_lost(self, error: Exception | None) -> None:
        """Called by asyncio: it has ended."""
        self._server.left(self)

    def data_received(self, data: bytes) -> None:
        """Called by asyncio: bytes came."""
        self._server.heard(self, self._stream.receive(data))

    @property
    def name(self) -> str:
        """Its address, for logs."""
        host, port, *_ = self._transport.get_extra_info("peername") or ("?", 0)
        return f"{host}:{port}"

    def tell(self, unit: bytes, cut: int, now_s: float) -> bool:
        """Send the newest state, in two pieces as readers of the paper's kind get it; False: give it up.

        A client that has not read the state before gets none now: the next one is newer. After 5 s
        of that it is given up.
        """
        if self._transport.get_write_buffer_size():
            self._behind_since_s = self._behind_since_s or now_s
            return now_s - self._behind_since_s < _PATIENCE_S
        self._behind_since_s = None
        self._transport.write(unit[:cut])
        self._transport.write(unit[cut:])
        return True

    def answer(self, unit: bytes) -> None:
        """Send an answer; one who sends much and reads nothing gets none."""
        if self._transport.get_write_buffer_size() < _ANSWERS_BYTES:
            self._transport.write(unit)

    def close(self, last: bytes = b"") -> None:
        """Close the connection, with a last unit."""
        self._transport.write(last)
        self._transport.close()

    def abort(self) -> None:
        """Close the connection now."""
        self._transport.abort()

    def freeze(self) -> None:
        """Read no more; the socket stays open."""
        if not self._transport.is_closing():
            self._transport.pause_reading()
