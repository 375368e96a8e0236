"""One TCP connection to a controller: written at once or not at all, read straight into a callback."""

import asyncio
import contextlib
import os
import socket
from collections.abc import Callable

from protocol_gateway.errors import LinkCloggedError, LinkDownError

# A unit is some hundred bytes. A small send buffer makes a controller that does not read an
# error at once instead of kilobytes of commands that it would obey late.
_SEND_BUFFER_BYTES = 4096
# What we wrote and the controller's host has not acknowledged for this long breaks the connection.
_UNACKNOWLEDGED_MS = 3000
# How long a controller that goes on sending has to take what was sent to it last.
_LAST_WORD_S = 0.1


class Connection(asyncio.Protocol):
    """One TCP connection; `lost` is done, with the reason in words, when it has ended."""

    _transport: asyncio.Transport

    def __init__(self, made: Callable[["Connection"], None], receive: Callable[[bytes], None]) -> None:
        self._made = made
        self._receive = receive
        loop = asyncio.get_running_loop()
        self.lost: asyncio.Future[str] = loop.create_future()
        self._closed: asyncio.Future[None] = loop.create_future()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Called by asyncio: the connection stands."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        _configure(transport.get_extra_info("socket"))
        self._guarded(lambda: self._made(self))

    def data_received(self, data: bytes) -> None:
        """Called by asyncio: bytes came."""
        self._guarded(lambda: self._receive(data))

    def connection_lost(self, error: Exception | None) -> None:
        """Called by asyncio: it has ended."""
        reason = reason_of(error) if isinstance(error, OSError) else "the controller closed the connection"
        if not self.lost.done():
            self.lost.set_result(reason)
        self._closed.set_result(None)

    def write(self, data: bytes) -> None:
        """Put a whole unit on the socket, now.

        Raises:
            LinkDownError: If the connection has ended.
            LinkCloggedError: If the socket does not take it whole; the connection is given up then.
        """
        if self._transport.is_closing():
            raise LinkDownError("not sent: the connection has just ended")
        # asyncio writes at once when its buffer is empty, and here it always is: what does not
        # fit ends the connection, so that half a unit can never be completed later.
        self._transport.write(data)
        if self._transport.is_closing():
            raise LinkDownError("not sent: the connection broke while it was written")
        if self._transport.get_write_buffer_size():
            self._transport.abort()
            raise LinkCloggedError("not sent: the controller does not read; connecting again")

    async def end(self) -> None:
        """Close it, and wait until it is closed: what was written last, a stop perhaps, still arrives.

        A socket that is closed with something unread in it is reset, and a reset may take from the
        controller what it has not read yet. So only the sending ends at first, and what comes is read.
        """
        self._receive = _ignore
        try:
            if not self._transport.is_closing():
                with contextlib.suppress(OSError):  # the controller was faster
                    self._transport.write_eof()
                await asyncio.wait([self._closed], timeout=_LAST_WORD_S)
        finally:
            self._transport.abort()
        await self._closed

    def _guarded(self, call: Callable[[], None]) -> None:
        """Bad code ends `run` with its own exception; asyncio would only log it."""
        try:
            call()
        except Exception as error:
            if not self.lost.done():
                self.lost.set_exception(error)
            self._transport.abort()


def _ignore(data: bytes) -> None:
    """What comes after the end tells nobody anything."""


def _configure(connected: socket.socket) -> None:
    """Units go out at once; a host that vanished is noticed in seconds."""
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connected.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
    connected.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 2)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 1)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNACKNOWLEDGED_MS)


def reason_of(error: OSError) -> str:
    """What the system says is wrong, without the address that asyncio repeats."""
    if error.errno is not None and error.errno > 0:
        return os.strerror(error.errno).lower()
    return (error.strerror or str(error)).lower()
