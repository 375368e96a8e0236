"""Server of one simulated controller: answers each question immediately, except for the faults.

Each connection has its own table of assignments, or all share one, as with a controller without
multi-connection. Nothing but assignments can be written.
"""

import asyncio
import logging
import time
from collections.abc import Callable, Coroutine, Sequence
from typing import Any, Protocol

from controllers.fanuc.simulated import memory, messages
from controllers.fanuc.simulated.controller import SnpxController
from controllers.fanuc.simulated.memory import DELIVERED, AssignmentTable, Entry
from controllers.fanuc.simulated.messages import Packet, PacketStream
from controllers.fanuc.srtp import COMMANDS, LONGEST_TEXT, Area, Service
from controllers.simulated import faults as effects
from controllers.simulated.faults import Faults

logger = logging.getLogger(__name__)

SNPX_FAULTS = (
    *("freeze", "garbage", "split", "flood", "deluge", "drop", "jump", "corrupt", "local", "fault", "mute"),
    *("joints", "restart", "refuse", "burst", "busy", "loss"),
)
"""Faults that this controller can show; the others concern commands."""
MOST_CLIENTS = 4
"""As delivered: $SNPX_PARAM.$NUM_FRIF."""

_TICK_S = 0.01
_HOLD_BACK_S = 2.0
_PAUSE_S = 0.001
_LONGEST_BUFFER_BYTES = 4 * 1024 * 1024
_BUSY = 0x0700
_ALARM = (11, 1, "SRVO-001 Operator panel E-stop")
_GARBAGE_EACH = 10
# Each breaks another rule.
_GARBAGE = (
    b"\xff" * 60,
    bytes([3, 0, 7, 0, 0xFF, 0xFF]) + bytes(50),
    bytes([3, 0, 7, 0]) + bytes(27) + b"\xd4" + bytes(24),
    bytes([1, 0, 0, 0]) + bytes(27) + b"\x94" + bytes(24),
)


class Connected(Protocol):
    """A connection of the controller, which faults may end."""

    def abort(self) -> None:
        """Close the connection immediately."""
        ...


class SnpxServer:
    """Server of one controller.

    Args:
        boot: Creates the controller, after a restart without servos.
        shared: All connections have one table of assignments.
        entered: Assignments that an operator has entered at the pendant.
    """

    def __init__(
        self,
        boot: Callable[[bool], SnpxController],
        fault_schedule: Faults,
        *,
        shared: bool = False,
        entered: Sequence[Entry] = (),
    ) -> None:
        self._boot = boot
        self._faults = fault_schedule
        self.shared = shared
        self.table = AssignmentTable((*DELIVERED, *entered))
        self.controller = boot(False)
        self.clients: set[Connected] = set()
        self.active: frozenset[str] = frozenset()
        self.questions = 0

    def new_client(self) -> "Client":
        """Return the protocol of a connection."""
        return Client(self)

    def admit(self, client: "Connected") -> bool:
        """Register a connection, unless a fault forbids it, or there are too many."""
        now_s = time.monotonic()
        self._faults.first_client(now_s)
        self.apply_faults(now_s)
        if self.active & {"refuse", "restart"} or len(self.clients) >= MOST_CLIENTS:
            return False
        self.clients.add(client)
        return True

    async def run(self) -> None:
        """Move the arm until cancelled."""
        while True:
            now_s = time.monotonic()
            self.controller.tick(now_s)
            self.apply_faults(now_s)
            await asyncio.sleep(_TICK_S)

    def apply_faults(self, now_s: float) -> None:
        """Update the active faults, and apply their effects on the controller."""
        self.active, begun, ended = self._faults.changes(self.active, now_s)
        if "fault" in begun:
            self.controller.raise_alarm(*_ALARM, now_s)
        if "restart" in begun:
            self.controller = self._boot(True)
        if "fault" in ended:
            self.controller.reset(now_s)
        if begun & {"restart", "refuse"} or self._faults.drops(now_s):
            self.close()

    def close(self) -> None:
        """Close all connections."""
        for client in [*self.clients]:
            client.abort()

    # -------------------------------------------------------------------------- answers

    def answer(self, packet: Packet, client: "Client", now_s: float) -> bytes:
        """Return the answer to a packet."""
        self.questions += 1
        if not packet.kind:
            return messages.connected()
        if "busy" in self.active and self.questions % 2 and packet.service == Service.READ:
            return messages.refusal(packet, _BUSY)
        match packet.service:
            case Service.SESSION:
                return messages.answer(packet)
            case Service.READ:
                data = self._read(packet, client, now_s)
                return messages.refusal(packet) if data is None else messages.answer(packet, data)
            case Service.WRITE if packet.area == COMMANDS:
                text = packet.text[: packet.count].decode("ascii", "replace")
                done = client.command(text)
                return messages.answer(packet) if done else messages.refusal(packet)
        return messages.refusal(packet)

    def _read(self, packet: Packet, client: "Client", now_s: float) -> bytes | None:
        """Return what a client reads; None: it cannot."""
        if packet.area == Area.WORDS:
            last = packet.first + packet.count
            if not packet.count or 2 * packet.count > LONGEST_TEXT or last > memory.LAST_WORD:
                return None
            return client.table.words(self.controller, packet.first + 1, packet.count, now_s, self.active)
        outputs = packet.area == Area.ROBOT_OUTPUTS
        if not outputs and packet.area != Area.ROBOT_INPUTS:
            return None
        if outputs and "mute" in self.active and packet.first >= 6000:
            return None
        first, count = packet.first - packet.first % 8, packet.count + packet.first % 8
        count += -count % 8
        if not 0 < count <= 8 * LONGEST_TEXT:
            return None
        return memory.bits(self.controller, outputs=outputs, first=first, count=count, active=self.active)


class Client(asyncio.Protocol):
    """A client's connection.

    Attributes:
        table: Its assignments.
    """

    _transport: asyncio.Transport

    def __init__(self, server: SnpxServer) -> None:
        self._server = server
        self._packets = PacketStream()
        self.table = server.table
        self._held_back = self._pieces = b""
        self._tasks: set[asyncio.Task[None]] = set()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Register the connection (called by asyncio)."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        if not self._server.admit(self):
            self.abort()

    def connection_lost(self, error: Exception | None) -> None:
        """Forget the connection and its table (called by asyncio)."""
        self._server.clients.discard(self)
        for task in self._tasks:
            task.cancel()

    def abort(self) -> None:
        """Close the connection immediately."""
        self._transport.abort()

    def command(self, text: str) -> bool:
        """Do what a client's text says; False: it is refused."""
        if text.strip() != "CLRASG":
            return self.table.command(text, self._server.controller)
        if self._server.shared:
            self.table.entries.clear()
        else:
            self.table = AssignmentTable()
        return True

    def data_received(self, data: bytes) -> None:
        """Answer the packets in the next bytes (called by asyncio)."""
        server, now_s = self._server, time.monotonic()
        server.apply_faults(now_s)
        active = server.active
        for packet in self._packets.receive(data):
            answer = server.answer(packet, self, now_s)
            if "freeze" in active:
                continue
            if packet.service == Service.READ:
                self._send(answer, active)
            else:
                # The begin of a connection is answered, so that the fault concerns what follows.
                self.write(answer)
        if self._packets.broken:
            self.abort()

    def _send(self, data: bytes, active: frozenset[str]) -> None:
        number = self._server.questions
        if "loss" in active and not number % 3:
            return
        index, rest = divmod(number, _GARBAGE_EACH)
        if "garbage" in active and not rest:
            self.write(_GARBAGE[index % len(_GARBAGE)])
        data *= effects.copies(active)
        if "burst" in active:
            if not self._held_back:
                self._start(self._release())
            self._held_back += data
        elif "split" in active:
            if not self._pieces:
                self._start(self._write_pieces())
            self._pieces += data
        else:
            self.write(data)

    async def _release(self) -> None:
        await asyncio.sleep(_HOLD_BACK_S)
        data, self._held_back = self._held_back, b""
        self.write(data)

    async def _write_pieces(self) -> None:
        while self._pieces:
            data, self._pieces = self._pieces, b""
            for piece in effects.pieces(data):
                self.write(piece)
                await asyncio.sleep(_PAUSE_S)

    def _start(self, work: Coroutine[Any, Any, None]) -> None:
        task: asyncio.Task[None] = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def write(self, data: bytes) -> None:
        """Write data, unless the connection ends or the client leaves megabytes unread."""
        if self._transport.is_closing():
            return
        if self._transport.get_write_buffer_size() > _LONGEST_BUFFER_BYTES:
            logger.warning("a client does not read: closed")
            self.abort()
            return
        self._transport.write(data)
