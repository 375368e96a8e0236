"""One TCP connection to a controller: written at once or not at all, read straight into a callback."""

import asyncio
import contextlib
import os
import socket
import struct
from collections.abc import Callable

from protocol_gateway.errors import LinkCloggedError, LinkDownError
from protocol_gateway.sockets import configure
from robomesh import reason_codes as codes

# A unit is some hundred bytes. A small send buffer makes a controller that does not read an
# error at once instead of kilobytes of commands that it would obey late.
_SEND_BUFFER_BYTES = 4096
# A piece of this size holds so few units that no other robot waits for its parsing.
READ_BYTES = 16 * 1024
"""At most so many come at a time: with all of them, there may be more."""
# What we wrote and the controller's host has not acknowledged for this long breaks the connection.
_UNACKNOWLEDGED_MS = 3000
# How long a controller that goes on sending has to take what was sent to it last.
_FINAL_SEND_S = 0.1
# Of Linux's `struct tcp_info`: tcpi_rtt, microseconds, smoothed.
_ROUND_TRIP_AT = 68


class Connection(asyncio.BufferedProtocol):
    """One TCP connection; `lost` is done, with the reason in words, when it has ended."""

    _transport: asyncio.Transport

    def __init__(
        self, on_connected: Callable[["Connection"], None], receive: Callable[[bytes], None]
    ) -> None:
        self._on_connected = on_connected
        self._receive = receive
        loop = asyncio.get_running_loop()
        self.lost: asyncio.Future[str] = loop.create_future()
        self._closed: asyncio.Future[None] = loop.create_future()
        # Its own: without one asyncio maps 256 KiB of memory anew for each read, which costs more than
        # all that is done with a unit.
        self._buffer = bytearray(READ_BYTES)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Called by asyncio: the connection stands."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        configure(
            transport.get_extra_info("socket"),
            send_buffer_bytes=_SEND_BUFFER_BYTES,
            unacknowledged_ms=_UNACKNOWLEDGED_MS,
        )
        self._call_or_fail(lambda: self._on_connected(self))

    def get_buffer(self, sizehint: int) -> bytearray:
        """Called by asyncio: where bytes are to be put."""
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        """Called by asyncio: so many bytes came."""
        data = bytes(memoryview(self._buffer)[:nbytes])
        self._call_or_fail(lambda: self._receive(data))

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
            raise LinkDownError(codes.LINK_JUST_ENDED())
        # asyncio writes at once when its buffer is empty, and here it always is: what does not
        # fit ends the connection, so that half a unit can never be completed later.
        self._transport.write(data)
        if self._transport.is_closing():
            raise LinkDownError(codes.LINK_BROKE())
        if self._transport.get_write_buffer_size():
            self._transport.abort()
            raise LinkCloggedError(codes.LINK_CLOGGED())

    def pause(self, seconds: float) -> None:
        """Read nothing for so long; what is written goes out all the same."""
        self._transport.pause_reading()
        self.later(seconds, self._transport.resume_reading)

    def later(self, seconds: float, call: Callable[[], None]) -> asyncio.TimerHandle:
        """Call something then; bad code in it ends the link, as it would from `receive`."""
        return asyncio.get_running_loop().call_later(seconds, self._call_or_fail, call)

    def give_up(self, why: str) -> None:
        """End it now, for a reason of ours in words."""
        if not self.lost.done():
            self.lost.set_result(why)
        self._transport.abort()

    @property
    def round_trip_s(self) -> float | None:
        """To the controller's host and back, as the kernel has measured it [s]; None: it does not tell."""
        connected: socket.socket = self._transport.get_extra_info("socket")
        try:
            told = connected.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 128)
            (microseconds,) = struct.unpack_from("=I", told, _ROUND_TRIP_AT)
        except (OSError, AttributeError, struct.error):  # it has just ended; not Linux
            return None
        return float(microseconds) * 1e-6

    async def end(self) -> None:
        """Close it, and wait until it is closed: what was written last, a stop perhaps, still arrives.

        A socket that is closed with something unread in it is reset, and a reset may take from the
        controller what it has not read yet. So only the sending ends at first, and what comes is read.
        """
        self._receive = _ignore
        self._transport.resume_reading()
        try:
            if not self._transport.is_closing():
                with contextlib.suppress(OSError):  # the controller was faster
                    self._transport.write_eof()
                await asyncio.wait([self._closed], timeout=_FINAL_SEND_S)
        finally:
            self._transport.abort()
        await self._closed

    def _call_or_fail(self, call: Callable[[], None]) -> None:
        """Bad code ends `run` with its own exception; asyncio would only log it."""
        try:
            call()
        except Exception as error:
            if not self.lost.done():
                self.lost.set_exception(error)
            self._transport.abort()


def _ignore(data: bytes) -> None:
    """What comes after the end tells nobody anything."""


def reason_of(error: OSError) -> str:
    """What the system says is wrong, without the address that asyncio repeats."""
    if error.errno is not None and error.errno > 0:
        return os.strerror(error.errno).lower()
    return (error.strerror or str(error)).lower()
