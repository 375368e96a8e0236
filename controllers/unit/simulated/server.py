"""Server of one simulated controller: sends its state at a fixed rate and executes its clients' units."""

import asyncio
import itertools
import logging
import time
from collections.abc import Callable

from controllers.simulated.faults import Faults, copies, pieces
from controllers.unit.simulated import unit_faults
from controllers.unit.simulated.controller import Controller
from controllers.unit.simulated.execution import MALFORMED
from protocol_gateway.unit_protocol.records import (
    AbsolutePositions,
    Command,
    Error,
    RelativePositions,
    asks_to_stop,
    write_unit,
)
from protocol_gateway.unit_protocol.stream import Malformed, StreamEvent, Unit
from protocol_gateway.unit_server.client import Client

logger = logging.getLogger(__name__)

_TOO_MANY = Error(1, "too many clients")
# Prime, so that the position at which a unit is cut takes every value.
_CUT_STEP = 37
_HOLD_BACK_S = 2.0
_PAUSE_S = 0.001


class Server:
    """Server of one controller.

    Args:
        boot: Creates the controller after a restart, at rest, for the fault_schedule time.
    """

    def __init__(
        self,
        controller: Controller,
        boot: Callable[[float], Controller],
        fault_schedule: Faults,
        *,
        max_clients: int,
    ) -> None:
        self._controller = controller
        self._boot = boot
        self._max_clients = max_clients
        self._clients: list[Client] = []
        self._connections: set[Client] = set()
        self._empty = asyncio.Event()
        self._faults = fault_schedule
        self._active: frozenset[str] = frozenset()
        self._held_back: list[bytes] = []
        self._held_back_since_s = 0.0

    def new_client(self) -> Client:
        """Return the protocol of a connection that has just been accepted."""
        return Client(self, self._controller.table)

    async def run(self, rate_hz: float) -> None:
        """Send the state at the rate until cancelled. Missed ticks are skipped, not made up for."""
        period_s = 1.0 / rate_hz
        noise = unit_faults.garbage()
        next_s = time.monotonic()
        for number in itertools.count():
            now_s = time.monotonic()
            self._controller.tick(now_s)
            self._apply_faults(now_s)
            if self._clients and "freeze" not in self._active:
                before = next(noise) if "garbage" in self._active else b""
                await self._send(before + self._state_unit(now_s), number, now_s)
            next_s = max(next_s + period_s, now_s)
            await asyncio.sleep(next_s - time.monotonic())

    async def close(self) -> None:
        """Close every connection."""
        for client in tuple(self._connections):
            client.abort()
        if self._connections:
            await self._empty.wait()

    # ------------------------------------------------------------------------ clients

    def client_connected(self, client: Client) -> None:
        """Accept a client, or reject it if there are too many."""
        self._connections.add(client)
        self._empty.clear()
        self._apply_faults(time.monotonic())
        if "restart" in self._active:
            client.abort()
            return
        if len(self._clients) >= self._max_clients or "refuse" in self._active:
            logger.warning("client %s rejected: too many clients", client.name)
            client.close(write_unit((_TOO_MANY,), self._controller.table))
            return
        self._clients.append(client)
        self._faults.first_client(time.monotonic())
        logger.info("client %s connected, %d in all", client.name, len(self._clients))

    def client_disconnected(self, client: Client) -> None:
        """Remove a client that has disconnected."""
        if client in self._clients:
            self._clients.remove(client)
            logger.info("client %s disconnected, %d left", client.name, len(self._clients))
        self._connections.discard(client)
        if not self._connections:
            self._empty.set()

    def client_dropped(self, client: Client, why: str) -> None:
        """Log that a client is closed because it misbehaved."""
        logger.warning("client %s %s: closed", client.name, why)

    def units_received(self, client: Client, events: list[StreamEvent]) -> None:
        """Execute a client's units in order; answer the refused ones."""
        now_s = time.monotonic()
        self._apply_faults(now_s)
        if client not in self._clients or "freeze" in self._active:
            return
        for event in events:
            refusal = self._refusal_of(event, now_s)
            if refusal is not None:
                logger.info("refused: %s", refusal.text)
                client.answer(write_unit((refusal,), self._controller.table))

    def stops_received(self, client: Client, events: list[StreamEvent]) -> None:
        """Do nothing: a controller ignores units of a rejected client."""

    def client_throttled(self, client: Client) -> None:
        """Do nothing: the rate of a client's units is not limited."""

    def _refusal_of(self, event: StreamEvent, now_s: float) -> Error | None:
        if isinstance(event, Malformed):
            return Error(MALFORMED, f"malformed, {event.reason}")
        if "deaf" in self._active and asks_to_stop(event.records):
            return None
        refusal = unit_faults.refusal(event.records, self._active) if _is_request(event) else None
        if refusal is None:
            refusal = self._controller.execute(event.records, now_s)
            if "fault" in self._active and any(_resets(record) for record in event.records):
                self._faults.end("fault")
        return refusal

    # ---------------------------------------------------------------------- state

    def _state_unit(self, now_s: float) -> bytes:
        records = unit_faults.faulty_records(self._controller.state_records(now_s), self._active, now_s)
        return write_unit(records, self._controller.table)

    async def _send(self, unit: bytes, number: int, now_s: float) -> None:
        if "burst" in self._active:
            self._held_back.append(unit)
            if now_s - self._held_back_since_s < _HOLD_BACK_S:
                return
        if self._held_back:
            unit = b"".join(self._held_back)
            self._held_back, self._held_back_since_s = [], now_s
        if "split" in self._active:
            await _send_in_pieces(tuple(self._clients), unit)
            return
        unit *= copies(self._active)
        for client in tuple(self._clients):
            client.send_state(unit, number * _CUT_STEP % len(unit))

    # ---------------------------------------------------------------------------- faults

    def _apply_faults(self, now_s: float) -> None:
        """Update the active faults and apply their effects on connections and controller."""
        self._active, begun, ended = self._faults.changes(self._active, now_s)
        for name in begun:
            self._begin(name, now_s)
        if "freeze" in ended:
            for client in self._clients:
                client.resume_reading()
        if "freeze" in self._active:
            for client in self._clients:
                client.pause_reading()
        if self._faults.drops(now_s):
            self._abort_all()

    def _begin(self, name: str, now_s: float) -> None:
        match name:
            case "burst":
                self._held_back_since_s = now_s
            case "fault":
                self._controller.execute((Command(("stop",)),), now_s)
                unit = write_unit((unit_faults.fault_error(),), self._controller.table)
                for client in self._clients:
                    client.answer(unit)
            case "restart":
                self._controller = self._boot(now_s)
                self._abort_all()
            case "refuse":
                unit = write_unit((_TOO_MANY,), self._controller.table)
                for client in tuple(self._clients):
                    client.close(unit)

    def _abort_all(self) -> None:
        for client in tuple(self._clients):
            client.abort()


async def _send_in_pieces(clients: tuple[Client, ...], unit: bytes) -> None:
    for piece in pieces(unit):
        for client in clients:
            client.answer(piece)
        await asyncio.sleep(_PAUSE_S)


def _is_request(unit: Unit) -> bool:
    return any(isinstance(each, Command | AbsolutePositions | RelativePositions) for each in unit.records)


def _resets(record: object) -> bool:
    return isinstance(record, Command) and "reset" in record.words
