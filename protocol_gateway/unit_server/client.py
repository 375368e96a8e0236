"""One TCP client of a server of units (a simulated controller or the gateway), with its limits.

    keeps up   --socket full--> behind: only the newest state is kept --socket empty--> sent, keeps up
    all units  --over its limits--> stops only --for a second or two--> all units
    behind for 5 s, or over its limits for 5 s --> dropped; its stops are read until the end

A slow client costs its server the memory of one unit, and no time.
"""

import asyncio
import contextlib
from collections.abc import Sequence
from typing import Protocol

from protocol_gateway.unit_protocol.codes import CodeTable
from protocol_gateway.unit_protocol.stream import StreamEvent, UnitStream
from protocol_gateway.unit_server.rate_limit import Budget, Limits
from protocol_gateway.unit_server.sockets import configure

# Small: the server must notice a client that does not read, instead of filling its buffer with old states.
_SEND_BUFFER_BYTES = 16 * 1024
_ANSWERS_BYTES = 64 * 1024
_PATIENCE_S = 5.0
# A chunk of this size holds so few units that its parsing delays no other client.
_READ_BYTES = 1024
# Longer than _PATIENCE_S: a client that only does not read is dropped with its reason before this timeout.
_UNACKNOWLEDGED_MS = 6000
_FINAL_SEND_S = 0.5
# Between reads of a throttled client: 200 KiB/s.
_STOPS_ONLY_PAUSE_S = 0.005


class Server(Protocol):
    """Callbacks of a client's server."""

    def client_connected(self, client: "Client") -> None:
        """Handle a new connection."""
        ...

    def client_disconnected(self, client: "Client") -> None:
        """Handle the end of a connection."""
        ...

    def units_received(self, client: "Client", events: list[StreamEvent]) -> None:
        """Handle units, or malformed bytes."""
        ...

    def stops_received(self, client: "Client", events: list[StreamEvent]) -> None:
        """Handle units that may hold a stop, from a client that is throttled or being closed.

        The server ignores everything else in them.
        """
        ...

    def client_throttled(self, client: "Client") -> None:
        """Handle a client that exceeds its limits."""
        ...

    def client_dropped(self, client: "Client", why: str) -> None:
        """Report that this end closes the connection, and why; `client_disconnected` follows."""
        ...


class Client(asyncio.BufferedProtocol):
    """A client's connection.

    Args:
        limits: Rate limits for the client; None: no limits.

    Attributes:
        got_state: A state was sent to the client.
        skipped: States that were not sent, because newer ones replaced them before the client had read.
    """

    _transport: asyncio.Transport

    def __init__(self, server: Server, table: CodeTable, limits: Limits | None = None) -> None:
        self._server = server
        self._stream = UnitStream(table)
        self._stop_markers = table.command_markers("stop")
        self._loop = asyncio.get_running_loop()
        self._budget = None if limits is None else Budget(limits, self._loop.time())
        self._read_buffer = bytearray(_READ_BYTES)
        self._newest = b""
        self._patience: asyncio.TimerHandle | None = None  # while it is behind
        self._pause: asyncio.TimerHandle | None = None  # until the next read
        self._end: asyncio.TimerHandle | None = None  # while it is being closed
        self._closing = False
        self._stops_only_until_s = 0.0
        self.got_state = False
        self.skipped = 0

    # ---------------------------------------------------------------- called by asyncio

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Configure the socket of a new connection."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        # The client is behind as soon as the socket does not take everything.
        transport.set_write_buffer_limits(high=0)
        configure(
            transport.get_extra_info("socket"),
            send_buffer_bytes=_SEND_BUFFER_BYTES,
            unacknowledged_ms=_UNACKNOWLEDGED_MS,
        )
        self._server.client_connected(self)

    def connection_lost(self, error: Exception | None) -> None:
        """Cancel the timers and notify the server."""
        self._cancel_timers()
        self._server.client_disconnected(self)

    def get_buffer(self, sizehint: int) -> bytearray:
        """Return the buffer for the next bytes."""
        return self._read_buffer

    def buffer_updated(self, count: int) -> None:
        """Parse received bytes, within the client's limits."""
        now_s, data = self._loop.time(), bytes(self._read_buffer[:count])
        if self._closing or now_s < self._stops_only_until_s:
            self._read_stops_only(data)
            return
        events = self._stream.receive(data)
        if events:
            self._server.units_received(self, events)
        if self._budget is None or self._closing:
            return
        over_s = self._budget.spend(units=len(events), length=count, now_s=now_s)
        if over_s and self._budget.is_flood(now_s):
            self._server.client_dropped(self, "sends more than it may")
            self.close()
        elif over_s:
            self._stops_only_until_s = now_s + over_s
            self._server.client_throttled(self)

    def pause_writing(self) -> None:
        """Start the timeout of a client that does not read: the socket is full."""
        if not self._closing:
            self._patience = self._loop.call_later(_PATIENCE_S, self._drop)

    def resume_writing(self) -> None:
        """Send the newest state: the socket has taken everything."""
        if self._patience is not None:
            self._patience.cancel()
            self._patience = None
        # Deferred, because asyncio ends the connection twice when a write fails inside this callback.
        self._loop.call_soon(self._send_newest)

    def _send_newest(self) -> None:
        if self._patience is None:
            unit, self._newest = self._newest, b""
            self._write(unit)

    # ------------------------------------------------------------------- for its server

    @property
    def address(self) -> tuple[str, int]:
        """Host and port of the client."""
        host, port, *_ = self._transport.get_extra_info("peername") or ("0.0.0.0", 0)
        return host, port

    @property
    def name(self) -> str:
        """Address of the client, for logs."""
        host, port = self.address
        return f"{host}:{port}"

    def send_state(self, unit: bytes, cut: int = 0, *, earlier: Sequence[bytes] = ()) -> None:
        """Send the newest state, or keep it until the client has read the one before.

        Args:
            cut: Offset at which the unit is split into two writes, as the paper's controllers split it.
            earlier: Units that came just before; sent only to a client that keeps up.
        """
        if self._closing:
            return
        self.got_state = True
        if self._patience is not None or self._newest:
            self.skipped += len(earlier) + bool(self._newest)
            self._newest = unit
            return
        self._write(b"".join(earlier))
        self._write(unit[:cut])
        self._write(unit[cut:])

    def answer(self, unit: bytes) -> None:
        """Send an answer, unless the client has left too many answers unread."""
        if self._transport.get_write_buffer_size() < _ANSWERS_BYTES:
            self._write(unit)

    def close(self, last: bytes = b"") -> None:
        """Close the connection after a last unit; until it ends, stops are still read.

        Closing a socket that holds unread bytes resets it, and the client may lose the last unit to the
        reset. Therefore only the sending direction is closed first.
        """
        if self._closing:
            return
        self._write(last)
        self._closing = True
        self._newest = b""
        self._cancel_timers()
        with contextlib.suppress(OSError, RuntimeError):  # the client has already closed
            self._transport.write_eof()
            self._transport.resume_reading()
        self._end = self._loop.call_later(_FINAL_SEND_S, self._transport.abort)

    def abort(self) -> None:
        """Close the connection immediately."""
        self._closing = True
        self._transport.abort()

    def pause_reading(self) -> None:
        """Stop reading; the socket stays open."""
        if not self._transport.is_closing():
            self._transport.pause_reading()

    def resume_reading(self) -> None:
        """Continue reading."""
        if not self._transport.is_closing():
            self._transport.resume_reading()

    # --------------------------------------------------------------------------- limits

    def _cancel_timers(self) -> None:
        for timer in (self._patience, self._pause, self._end):
            if timer is not None:
                timer.cancel()

    def _drop(self) -> None:
        self._server.client_dropped(self, "does not read")
        self.abort()

    def _read_stops_only(self, data: bytes) -> None:
        events = self._stream.receive(data, containing=self._stop_markers)
        if events:
            self._server.stops_received(self, events)
        if not self._transport.is_closing():
            self._transport.pause_reading()
            self._pause = self._loop.call_later(_STOPS_ONLY_PAUSE_S, self.resume_reading)

    def _write(self, data: bytes) -> None:
        """Write data, unless the connection is closing."""
        if data and not self._closing and not self._transport.is_closing():
            self._transport.write(data)
