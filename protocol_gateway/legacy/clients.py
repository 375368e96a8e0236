"""Server for old client programs, which connect by TCP as if the gateway were the controller.

    controller --unit--> gateway --immediately--> mesh, and the same bytes to every client
    client --unit--> with a stop: executed immediately, also from a rejected or throttled client
                     without a request (an echoed state): only renews the sender's lease
                     from a commander: executed in its operator's name, like a request over the mesh
                     from another client: ERROR 7, counted, audited

One controller connection serves all clients and the mesh with the same data at the same time.
Source: Chen, Zhang, Xue 2001, section 5, figures 7 and 8.
"""

import asyncio
import time
from collections.abc import Callable, Mapping

from protocol_gateway.authority.audit_entry import Entry, Outcome, entry_of
from protocol_gateway.execution.control import Control
from protocol_gateway.legacy.commander import Commander
from protocol_gateway.legacy.requests import (
    FAULT,
    MALFORMED,
    READ_ONLY,
    TOO_MANY,
    asks_for_more,
)
from protocol_gateway.legacy.settings import LegacySettings, plain_address
from protocol_gateway.telemetry.journal import Journal
from protocol_gateway.unit_protocol.codes import code_table
from protocol_gateway.unit_protocol.records import Error, asks_to_stop, write_unit
from protocol_gateway.unit_protocol.stream import Malformed, StreamEvent, Unit, printable
from protocol_gateway.unit_server.client import Client
from robomesh import reason_codes as codes
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.service.health import listen_when_possible
from robomesh.wire.session import Session
from robots.kinematics.joints import Joints

_S = schema.Event.Severity
# Most rejected clients that get an ERROR before they are closed; further ones are closed without it.
_MOST_REJECTED = 32


class LegacyClients:
    """Server of one robot's old client programs.

    Args:
        type_codes: The controller's type codes, as in the site file.
        audit: Writes the entry of a refused unit, without waiting for the disk.
        publish: Publishes the number of clients.
    """

    def __init__(
        self,
        settings: LegacySettings,
        type_codes: Mapping[int, str],
        joints: Joints,
        control: Control,
        *,
        journal: Journal,
        audit: Callable[[Entry], None],
        publish: Callable[[], None],
    ) -> None:
        self._settings = settings
        self._table = code_table(type_codes)
        self._joints = joints
        self._control = control
        self._journal, self._audit, self._publish = journal, audit, publish
        self._clients: dict[Client, Commander | None] = {}
        self._rejected: set[Client] = set()
        self._ending: set[asyncio.Task[None]] = set()
        self._empty = asyncio.Event()
        self._listener: asyncio.Server | None = None
        self._units: list[bytes] = []
        self._closing = False
        self._counts = schema.LegacyClients()

    async def listen(self, session: Session, robot: str) -> None:
        """Start to listen, as soon as the address can be used."""
        host, port = self._settings.host, self._settings.port

        async def listen() -> None:
            loop = asyncio.get_running_loop()
            self._listener = await loop.create_server(self._new_client, host, port)

        await listen_when_possible(session, f"legacy_clients of {robot}", host, port, listen)

    @property
    def counts(self) -> schema.LegacyClients:
        """Number of connected clients, and counters since the start."""
        counts = schema.LegacyClients()
        counts.CopyFrom(self._counts)
        counts.attached = len(self._clients)
        counts.states_skipped += sum(client.skipped for client in self._clients)
        return counts

    def relay(self, unit: bytes, answer: bool) -> None:
        """Relay the bytes of a controller's unit, after its data were published on the mesh.

        Args:
            answer: The unit refuses a unit of the gateway, which concerns only the client in control.
        """
        if answer:
            for client, commander in self._clients.items():
                if commander is not None and commander.holds_lease:
                    client.answer(unit)
        elif self._clients:
            if not self._units:
                asyncio.get_running_loop().call_soon(self._send_states)
            self._units.append(unit)

    def discard_states(self) -> None:
        """Discard the units of the present read: their positions cannot be."""
        self._units.clear()

    def _send_states(self) -> None:
        if not self._units:
            return
        *earlier, newest = self._units
        self._units.clear()
        for client in self._clients:
            client.send_state(newest, earlier=earlier)

    def link_is_down(self, why: str) -> None:
        """Close the clients that got states, as the controller would, so that they do not show stale ones."""
        for client in [client for client in self._clients if client.got_state]:
            client.close(self._error(FAULT, why))

    async def close(self) -> None:
        """Close every connection, and wait until their requests are executed or refused."""
        self._closing = True
        if self._listener is not None:
            self._listener.close()
        for client in [*self._clients, *self._rejected]:
            client.close(self._error(FAULT, "the gateway is shutting down"))
        while self._clients or self._rejected:
            self._empty.clear()
            await self._empty.wait()
        if self._ending:
            await asyncio.wait(self._ending)

    # -------------------------------------------------------- callbacks of its clients

    def client_connected(self, client: Client) -> None:
        """Accept a client, or reject it if there are too many."""
        if self._closing:
            client.abort()
            return
        operator = self._operator(client)
        if len(self._clients) >= self._settings.most - self._reserved_places(operator):
            self._reject(client)
            return
        self._clients[client] = self._commander(client, operator) if operator else None
        may = f"may command as {operator}" if operator else "reads"
        text = f"an old client program connected: {client.name} {may}, {len(self._clients)} in all"
        self._journal.report(_S.INFO, "legacy.attached", text, client=client.name)
        self._publish()

    def client_disconnected(self, client: Client) -> None:
        """Remove a client, and end its lease."""
        self._rejected.discard(client)
        if client in self._clients:
            commander = self._clients.pop(client)
            self._counts.states_skipped += client.skipped
            if commander is not None:
                commander.end(codes.ENDED_CLIENT(name=commander.operator, client=client.name))
                task = asyncio.create_task(commander.settle())
                self._ending.add(task)
                task.add_done_callback(self._ending.discard)
            text = f"an old client program disconnected: {client.name}, {len(self._clients)} are left"
            self._journal.report(_S.INFO, "legacy.gone", text, client=client.name)
            self._publish()
        self._empty.set()

    def units_received(self, client: Client, events: list[StreamEvent]) -> None:
        """Execute a client's units; stops first."""
        if client not in self._clients:
            return
        self.stops_received(client, events)
        commander = self._clients[client]
        for event in events:
            if isinstance(event, Malformed):
                self._malformed(client, event)
                continue
            if commander is not None:
                commander.renew()
            if not asks_for_more(event.records):
                continue
            if commander is not None:
                commander.submit(event)
            else:
                self._counts.units_refused += 1
                refusal = Error(READ_ONLY, "read only: this address is not among the site file's commanders")
                self._refuse(client, "", event, refusal, False)

    def stops_received(self, client: Client, events: list[StreamEvent]) -> None:
        """Stop the robot if a unit asks for it, also from a rejected or throttled client."""
        if any(isinstance(event, Unit) and asks_to_stop(event.records) for event in events):
            by = self._operator(client) or f"legacy {client.address[0]}"
            self._control.stop(by=by, reason="a stop unit", source=f"legacy {client.name}")

    def client_throttled(self, client: Client) -> None:
        """Answer a throttled client that its units are ignored."""
        limits = self._settings.limits
        text = (
            f"more than {limits.units_per_s:g} units/s or {limits.bytes_per_s / 1024:g} KiB/s: "
            "for the next second or two only stops are executed"
        )
        client.answer(self._error(FAULT, text))

    def client_dropped(self, client: Client, why: str) -> None:
        """Report a client that this end closes."""
        if client in self._clients:
            self._counts.closed += 1
            text = f"an old client program was closed: {client.name} {why}"
            self._journal.report(_S.WARNING, "legacy.closed", text, client=client.name)

    # ------------------------------------------------------------------------ internal

    def _operator(self, client: Client) -> str:
        """Return the operator name under which a client may command; empty: it may not."""
        host, _ = client.address
        return self._settings.commanders.get(plain_address(host), "")

    def _reserved_places(self, operator: str) -> int:
        """Return the number of reserved places: readers leave one for the first commander."""
        commanders = self._settings.commanders and not operator
        return int(bool(commanders) and not any(self._clients.values()))

    def _new_client(self) -> Client:
        return Client(self, self._table, self._settings.limits)

    def _reject(self, client: Client) -> None:
        self._counts.turned_away += 1
        text = f"an old client program was rejected: {client.name}, {self._settings.most} are connected"
        self._journal.report(_S.WARNING, "legacy.turned_away", text, client=client.name)
        if len(self._rejected) >= _MOST_REJECTED:
            client.abort()
            return
        self._rejected.add(client)
        client.close(self._error(TOO_MANY, "too many clients"))

    def _commander(self, client: Client, operator: str) -> Commander:
        def refuse(unit: Unit, error: Error, written: bool) -> None:
            self._refuse(client, operator, unit, error, written)

        return Commander(
            self._control,
            self._joints,
            operator=operator,
            source=f"legacy {client.name}",
            refuse=refuse,
        )

    def _malformed(self, client: Client, malformed: Malformed) -> None:
        self._counts.units_refused += 1
        self._journal.report(
            _S.WARNING,
            "legacy.malformed",
            f"a unit from the old client program {client.name} is malformed: {malformed.reason}",
            client=client.name,
            offset=malformed.offset,
            bytes=malformed.text,
            reason=malformed.reason,
        )
        refusal = Error(MALFORMED, f"malformed, {malformed.reason}")
        client.answer(self._error(refusal.number, refusal.text))
        commander = self._clients.get(client)
        self._write_down(client, commander.operator if commander else "", malformed.text, refusal)

    def _refuse(self, client: Client, operator: str, unit: Unit, error: Error, written: bool) -> None:
        """Answer a unit that is not executed; `written`: the refusal is already audited."""
        client.answer(self._error(error.number, error.text))
        if not written:
            self._write_down(client, operator, printable(unit.data), error)

    def _write_down(self, client: Client, operator: str, unit: str, error: Error) -> None:
        host, _ = client.address
        self._audit(
            entry_of(
                "UNIT",
                time_ns=time.time_ns(),
                operator=operator or f"legacy {host}",
                source=f"legacy {client.name}",
                outcome=Outcome.REFUSED,
                text=f"Not sent: {error.text}.",
                unit=unit,
            )
        )

    def _error(self, number: int, text: str) -> bytes:
        # Units are ASCII.
        return write_unit((Error(number, text.replace("°", " deg").replace(";", ",")),), self._table)
