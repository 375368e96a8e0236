"""One connection to a controller, TCP or UDP: writes immediately or fails, reads into a callback."""

import asyncio
import contextlib
import os
import socket
import struct
from collections.abc import Callable
from typing import Any, Self, cast

from protocol_gateway.seam.errors import LinkCloggedError, LinkDownError
from protocol_gateway.unit_server.sockets import configure
from robomesh import reason_codes as codes
from robomesh.reasons import Reason

# A unit has some hundred bytes. With a small send buffer, a controller that does not read causes an error
# immediately, instead of kilobytes of commands that it would execute late.
_SEND_BUFFER_BYTES = 4096
# A chunk of this size holds so few units, even of one byte each, that parsing it delays no other robot.
READ_BYTES = 4 * 1024
"""Most bytes of one read; a read of this size means that more may wait."""
# Sent data that the controller's host has not acknowledged for this long break the connection.
_UNACKNOWLEDGED_MS = 3000
# A controller that goes on sending has this long to receive the last unit.
_FINAL_SEND_S = 0.1
# Offset of tcpi_rtt in Linux's `struct tcp_info`: smoothed, in microseconds.
_ROUND_TRIP_AT = 68


class _Socket(asyncio.BaseProtocol):
    """Common part of a TCP connection and a UDP socket: the link's callbacks, and the future of the end."""

    _transport: asyncio.Transport | asyncio.DatagramTransport

    def __init__(self, on_connected: Callable[[Self], None], receive: Callable[[bytes], None]) -> None:
        self._on_connected: Callable[[Any], None] = on_connected
        self._receive = receive
        loop = asyncio.get_running_loop()
        self.lost: asyncio.Future[Reason] = loop.create_future()
        self._closed: asyncio.Future[None] = loop.create_future()

    def _end_with(self, reason: Reason) -> None:
        self._lose(reason)
        self._closed.set_result(None)

    def _lose(self, reason: Reason) -> None:
        if not self.lost.done():
            self.lost.set_result(reason)

    def _discard_received(self) -> None:
        """Discard all further bytes."""
        self._receive = lambda data: None

    def _call_or_fail(self, call: Callable[[], None]) -> None:
        """Make an exception of the callback end `run`; asyncio would only log it."""
        try:
            call()
        except Exception as error:
            if not self.lost.done():
                self.lost.set_exception(error)
            self._transport.abort()


class Connection(_Socket, asyncio.BufferedProtocol):
    """One TCP connection; the future `lost` gets the reason when it has ended."""

    _transport: asyncio.Transport

    def __init__(self, on_connected: Callable[[Self], None], receive: Callable[[bytes], None]) -> None:
        super().__init__(on_connected, receive)
        # Own buffer: otherwise asyncio maps 256 KiB of memory for each read, which costs more than all
        # processing of a unit.
        self._buffer = bytearray(READ_BYTES)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Configure the socket and notify the link (called by asyncio)."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        configure(
            transport.get_extra_info("socket"),
            send_buffer_bytes=_SEND_BUFFER_BYTES,
            unacknowledged_ms=_UNACKNOWLEDGED_MS,
        )
        self._call_or_fail(lambda: self._on_connected(self))

    def get_buffer(self, sizehint: int) -> bytearray:
        """Return the read buffer (called by asyncio)."""
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        """Pass received bytes on (called by asyncio)."""
        data = bytes(memoryview(self._buffer)[:nbytes])
        self._call_or_fail(lambda: self._receive(data))

    def connection_lost(self, error: Exception | None) -> None:
        """Set `lost` to the reason of the end (called by asyncio)."""
        reason = codes.LINK_CLOSED_THERE()
        if isinstance(error, OSError):
            reason = codes.OTHER(detail=reason_of(error))
        self._end_with(reason)

    def write(self, data: bytes) -> None:
        """Write a whole unit to the socket immediately.

        Raises:
            LinkDownError: If the connection has ended.
            LinkCloggedError: If the socket does not take the whole unit; the connection is then aborted.
        """
        if self._transport.is_closing():
            raise LinkDownError(codes.LINK_JUST_ENDED())
        # asyncio writes immediately while its buffer is empty, which it always is here. A unit that does not
        # fit ends the connection, so that half a unit can never be completed later.
        self._transport.write(data)
        if self._transport.is_closing():
            raise LinkDownError(codes.LINK_BROKE())
        if self._transport.get_write_buffer_size():
            self._transport.abort()
            raise LinkCloggedError(codes.LINK_CLOGGED())

    def pause(self, seconds: float) -> None:
        """Stop reading for some seconds; writing continues."""
        self._transport.pause_reading()
        asyncio.get_running_loop().call_later(seconds, self._call_or_fail, self._transport.resume_reading)

    @property
    def round_trip_s(self) -> float | None:
        """Round-trip time to the controller's host, measured by the kernel [s]; None: unknown."""
        connected: socket.socket = self._transport.get_extra_info("socket")
        try:
            tcp_info = connected.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 128)
            (microseconds,) = struct.unpack_from("=I", tcp_info, _ROUND_TRIP_AT)
        except (OSError, AttributeError, struct.error):  # the connection has just ended, or not Linux
            return None
        return float(microseconds) * 1e-6

    async def end(self) -> None:
        """Close the connection and wait for it, so that the last unit, perhaps a stop, still arrives.

        Closing a socket that holds unread bytes resets it, and the controller may lose what it has not read
        yet. Therefore only the sending direction is closed first, and received bytes are read and discarded.
        """
        self._discard_received()
        self._transport.resume_reading()
        try:
            if not self._transport.is_closing():
                with contextlib.suppress(OSError):  # the controller has already closed
                    self._transport.write_eof()
                await asyncio.wait([self._closed], timeout=_FINAL_SEND_S)
        finally:
            self._transport.abort()
        await self._closed


class Datagrams(_Socket, asyncio.DatagramProtocol):
    """One UDP socket, connected to the controller's address: the kernel drops datagrams of other senders."""

    _transport: asyncio.DatagramTransport
    round_trip_s = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Notify the link (called by asyncio)."""
        # No assertion: before Python 3.12 asyncio's own class is not derived from it.
        self._transport = cast("asyncio.DatagramTransport", transport)
        self._call_or_fail(lambda: self._on_connected(self))

    def datagram_received(self, data: bytes, address: object) -> None:
        """Pass a datagram on (called by asyncio)."""
        self._call_or_fail(lambda: self._receive(data))

    def error_received(self, error: Exception) -> None:
        """End the connection: the controller's host has no such port (called by asyncio)."""
        reason = reason_of(error) if isinstance(error, OSError) else str(error)
        self._lose(codes.OTHER(detail=reason))

    def connection_lost(self, error: Exception | None) -> None:
        """Note the end (called by asyncio)."""
        self._end_with(codes.LINK_CLOSED())

    def write(self, data: bytes) -> None:
        """Send one datagram immediately.

        Raises:
            LinkDownError: If the connection has ended.
            LinkCloggedError: If the system does not take the datagram; the connection is then aborted.
        """
        if self.lost.done() or self._transport.is_closing():
            raise LinkDownError(codes.LINK_JUST_ENDED())
        self._transport.sendto(data)
        if self.lost.done():
            raise LinkDownError(codes.LINK_BROKE())
        # Selector transports have it; the stubs do not.
        if self._transport.get_write_buffer_size():  # type: ignore[attr-defined]
            self._transport.abort()
            raise LinkCloggedError(codes.LINK_CLOGGED())

    def pause(self, seconds: float) -> None:
        """Do nothing: the kernel drops unread datagrams."""

    async def end(self) -> None:
        """Close the socket."""
        self._discard_received()
        self._transport.abort()
        await self._closed


def reason_of(error: OSError) -> str:
    """Return the system's error text, without the address that asyncio repeats."""
    if error.errno is not None and error.errno > 0:
        return os.strerror(error.errno).lower()
    return (error.strerror or str(error)).lower()
