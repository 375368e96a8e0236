"""One TCP client of whoever serves units, a controller or the gateway: read at its rate, never waited for.

    keeps up --socket full--> behind: the newest state alone is kept --socket empty--> sent, keeps up
    heard    --over its limits--> overheard: nothing but a stop counts --for a second or two--> heard
    behind for 5 s, or over its limits for 5 s --> given up, overheard to the last

A client's trouble costs its server one unit of memory, and no time.
"""

import asyncio
import contextlib
from collections.abc import Sequence
from typing import Protocol

from protocol_gateway.core.codes import CodeTable
from protocol_gateway.core.stream import StreamEvent, UnitStream
from protocol_gateway.serving.rate_limit import Budget, Limits
from protocol_gateway.sockets import configure

# Small, so that a client that does not read is noticed before it is given old states for minutes.
_SEND_BUFFER_BYTES = 16 * 1024
_ANSWERS_BYTES = 64 * 1024
_PATIENCE_S = 5.0
# A piece of this size holds so few units that nobody waits for its parsing.
_READ_BYTES = 1024
# A host that vanished is noticed in seconds, and not before one that only does not read is given up in words.
_UNACKNOWLEDGED_MS = 6000
_LAST_WORD_S = 0.5
# Who is overheard is read at 200 KiB/s.
_NEXT_PIECE_S = 0.005


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

    def overheard(self, client: "Client", events: list[StreamEvent]) -> None:
        """As `heard`, of one that is over its limits, turned away or given up: nothing but a stop counts."""
        ...

    def outpaced(self, client: "Client") -> None:
        """It is over its limits."""
        ...

    def gave_up(self, client: "Client", why: str) -> None:
        """It is being closed by this end, for the reason in words; `left` follows."""
        ...


class Client(asyncio.BufferedProtocol):
    """A client's connection.

    Args:
        limits: Of what it may send; None: it may send what it likes.

    Attributes:
        told: It was told a state.
        skipped: States that it was not told, because newer ones came before it had read.
    """

    _transport: asyncio.Transport

    def __init__(self, server: Server, table: CodeTable, limits: Limits | None = None) -> None:
        self._server = server
        self._stream = UnitStream(table)
        self._stop = table.marks("stop")
        self._loop = asyncio.get_running_loop()
        self._budget = None if limits is None else Budget(limits, self._loop.time())
        self._read = bytearray(_READ_BYTES)
        self._newest = b""
        self._patience: asyncio.TimerHandle | None = None  # while it is behind
        self._pause: asyncio.TimerHandle | None = None  # until its next piece is read
        self._end: asyncio.TimerHandle | None = None  # while it is being closed
        self._closing = False
        self._overheard_until_s = 0.0
        self.told = False
        self.skipped = 0

    # ---------------------------------------------------------------- called by asyncio

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """The connection stands."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        # What is not in the socket is behind.
        transport.set_write_buffer_limits(high=0)
        configure(
            transport.get_extra_info("socket"),
            send_buffer_bytes=_SEND_BUFFER_BYTES,
            unacknowledged_ms=_UNACKNOWLEDGED_MS,
        )
        self._server.joined(self)

    def connection_lost(self, error: Exception | None) -> None:
        """It has ended."""
        self._cancel_timers()
        self._server.left(self)

    def get_buffer(self, sizehint: int) -> bytearray:
        """Where the next bytes go."""
        return self._read

    def buffer_updated(self, count: int) -> None:
        """Bytes came."""
        now_s, data = self._loop.time(), bytes(self._read[:count])
        if self._closing or now_s < self._overheard_until_s:
            self._overhear(data)
            return
        events = self._stream.receive(data)
        if events:
            self._server.heard(self, events)
        if self._budget is None or self._closing:
            return
        over_s = self._budget.spend(units=len(events), length=count, now_s=now_s)
        if over_s and self._budget.is_flood(now_s):
            self._server.gave_up(self, "sends more than it may")
            self.close()
        elif over_s:
            self._overheard_until_s = now_s + over_s
            self._server.outpaced(self)

    def pause_writing(self) -> None:
        """The socket is full."""
        if not self._closing:
            self._patience = self._loop.call_later(_PATIENCE_S, self._give_up)

    def resume_writing(self) -> None:
        """The socket has taken everything."""
        if self._patience is not None:
            self._patience.cancel()
            self._patience = None
        # Not from here: when a write fails inside this call, asyncio ends the connection twice.
        self._loop.call_soon(self._tell_newest)

    def _tell_newest(self) -> None:
        if self._patience is None:
            unit, self._newest = self._newest, b""
            self._write(unit)

    # ------------------------------------------------------------------- for its server

    @property
    def address(self) -> tuple[str, int]:
        """Its host and port."""
        host, port, *_ = self._transport.get_extra_info("peername") or ("0.0.0.0", 0)
        return host, port

    @property
    def name(self) -> str:
        """Its address, for logs."""
        host, port = self.address
        return f"{host}:{port}"

    def tell(self, unit: bytes, cut: int = 0, *, earlier: Sequence[bytes] = ()) -> None:
        """Send the newest state; a client that has not read the one before gets it when it has.

        Args:
            cut: Where the unit is cut into two pieces, as readers of the paper's kind get it.
            earlier: Units before it, which came with it: for a client that keeps up.
        """
        if self._closing:
            return
        self.told = True
        if self._patience is not None or self._newest:
            self.skipped += len(earlier) + bool(self._newest)
            self._newest = unit
            return
        self._write(b"".join(earlier))
        self._write(unit[:cut])
        self._write(unit[cut:])

    def answer(self, unit: bytes) -> None:
        """Send an answer; one who sends much and reads nothing gets none."""
        if self._transport.get_write_buffer_size() < _ANSWERS_BYTES:
            self._write(unit)

    def close(self, last: bytes = b"") -> None:
        """Close the connection, with a last unit; what comes meanwhile is overheard.

        A socket that is closed with something unread in it is reset, and a reset may take the last unit
        from the client. So only the sending ends at first.
        """
        if self._closing:
            return
        self._write(last)
        self._closing = True
        self._newest = b""
        self._cancel_timers()
        with contextlib.suppress(OSError, RuntimeError):  # the client was faster
            self._transport.write_eof()
            self._transport.resume_reading()
        self._end = self._loop.call_later(_LAST_WORD_S, self._transport.abort)

    def abort(self) -> None:
        """Close the connection now."""
        self._closing = True
        self._transport.abort()

    def freeze(self) -> None:
        """Read no more; the socket stays open."""
        if not self._transport.is_closing():
            self._transport.pause_reading()

    def read_on(self) -> None:
        """Read again."""
        if not self._transport.is_closing():
            self._transport.resume_reading()

    # --------------------------------------------------------------------------- limits

    def _cancel_timers(self) -> None:
        for timer in (self._patience, self._pause, self._end):
            if timer is not None:
                timer.cancel()

    def _give_up(self) -> None:
        self._server.gave_up(self, "does not read")
        self.abort()

    def _overhear(self, data: bytes) -> None:
        events = self._stream.receive(data, holding=self._stop)
        if events:
            self._server.overheard(self, events)
        if not self._transport.is_closing():
            self._transport.pause_reading()
            self._pause = self._loop.call_later(_NEXT_PIECE_S, self.read_on)

    def _write(self, data: bytes) -> None:
        """Write what is still for somebody."""
        if data and not self._closing and not self._transport.is_closing():
            self._transport.write(data)
