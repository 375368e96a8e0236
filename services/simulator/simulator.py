"""The simulated controller's server: clients, the clock, the state that everybody is told."""

import asyncio
import itertools
import logging
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from protocol_gateway.core.records import Error, write_unit
from protocol_gateway.core.stream import Malformed, StreamEvent
from robots.description import load
from robots.joints import joints_of
from services.errors import ListenError
from services.listen import check_reach, split_address
from services.simulator.client import Client
from services.simulator.controller import Controller
from services.simulator.demo import demo_tour
from services.simulator.errors import SimulatorError
from services.simulator.faults import garbage, parse_faults
from services.simulator.orders import MALFORMED

logger = logging.getLogger(__name__)

_TOO_MANY = 1
# Prime, so that the cut of a unit into two pieces wanders over all its places.
_CUT_STEP = 37


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What a simulated controller is.

    Attributes:
        robot: A library robot, or a path to a robot.toml or URDF.
        listen: `HOST:PORT`; port 0 takes a free one.
        rate_hz: State units a second.
        demo: Moves by itself until the first motion command, and begins homed.
        faults: `freeze` and `garbage`, with `@SECONDS` for when it begins.
        codes: Type codes, as in the site file; empty: names.
        insecure: May listen beyond loopback; the protocol has no TLS.
    """

    robot: str
    listen: str = "127.0.0.1:0"
    rate_hz: float = 100.0
    max_clients: int = 8
    demo: bool = False
    faults: tuple[str, ...] = ()
    codes: Mapping[int, str] = field(default_factory=dict)
    insecure: bool = False


async def serve(settings: Settings, *, ready: Callable[[str], None] | None = None) -> None:
    """Simulate a controller until cancelled.

    Args:
        ready: Gets the line `listening on HOST:PORT` once clients can come.

    Raises:
        ListenError: If it cannot listen there.
        SimulatorError: If the settings make no controller.
        DescriptionError: If there is no such robot.
    """
    host, port = split_address(settings.listen)
    if warning := check_reach("the simulator", host, secured=False, insecure=settings.insecure):
        logger.warning("%s", warning)
    server = _Server(settings)
    loop = asyncio.get_running_loop()
    try:
        listener = await loop.create_server(server.new_client, host, port)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)
        raise ListenError(f"the simulator cannot listen on {host}:{port}: {reason.lower()}") from None
    try:
        if ready is not None:
            ready(f"listening on {host}:{listener.sockets[0].getsockname()[1]}")
        await server.run()
    finally:
        listener.close()
        await server.close()


class _Server:
    """All clients of one controller."""

    def __init__(self, settings: Settings) -> None:
        if not 0.0 < settings.rate_hz <= 1000.0:
            raise SimulatorError(f"rate {settings.rate_hz:g} Hz is outside 0 to 1000 Hz")
        if settings.max_clients < 1:
            raise SimulatorError(f"{settings.max_clients} clients at most is too few: 1 or more")
        description = load(settings.robot)
        self._settings = settings
        self._faults = parse_faults(settings.faults)
        self._controller = Controller(
            joints_of(description),
            codes=settings.codes,
            demo=demo_tour(description) if settings.demo else None,
            now_s=time.monotonic(),
        )
        self._clients: list[Client] = []
        self._connections: set[Client] = set()
        self._empty = asyncio.Event()
        self._first_client_s: float | None = None

    def new_client(self) -> Client:
        """The protocol of a connection that has just been accepted."""
        return Client(self, self._controller.table)

    async def run(self) -> None:
        """Tell the state at the rate, for ever. A tick that comes late is left out, never made up for."""
        period_s = 1.0 / self._settings.rate_hz
        noise = garbage()
        next_s = time.monotonic()
        for number in itertools.count():
            now_s = time.monotonic()
            self._controller.tick(now_s)
            if self._has("freeze", now_s):
                self._freeze()
            elif self._clients:
                before = next(noise) if self._has("garbage", now_s) else b""
                unit = before + self._controller.told(now_s)
                self._tell(unit, number * _CUT_STEP % len(unit), now_s)
            next_s = max(next_s + period_s, now_s)
            await asyncio.sleep(next_s - time.monotonic())

    async def close(self) -> None:
        """Close every connection."""
        for client in tuple(self._connections):
            client.abort()
        if self._connections:
            await self._empty.wait()

    # ------------------------------------------------------------------------ clients

    def joined(self, client: Client) -> None:
        """Take a client in, or turn it away."""
        self._connections.add(client)
        self._empty.clear()
        if len(self._clients) >= self._settings.max_clients:
            logger.warning("client %s turned away: too many clients", client.name)
            client.close(write_unit((Error(_TOO_MANY, "too many clients"),), self._controller.table))
            return
        self._clients.append(client)
        self._first_client_s = self._first_client_s or time.monotonic()
        logger.info("client %s has come, %d in all", client.name, len(self._clients))

    def left(self, client: Client) -> None:
        """Forget a client."""
        if client in self._clients:
            self._clients.remove(client)
            logger.info("a client has gone, %d are left", len(self._clients))
        self._connections.discard(client)
        if not self._connections:
            self._empty.set()

    def heard(self, client: Client, events: list[StreamEvent]) -> None:
        """Do what a client's units say, in their order; answer those that are refused."""
        if client not in self._clients or self._has("freeze", time.monotonic()):
            return
        for event in events:
            if isinstance(event, Malformed):
                refusal: Error | None = Error(MALFORMED, f"malformed, {event.reason}")
            else:
                refusal = self._controller.obey(event.records, time.monotonic())
            if refusal is not None:
                logger.info("refused: %s", refusal.text)
                client.answer(write_unit((refusal,), self._controller.table))

    def _tell(self, unit: bytes, cut: int, now_s: float) -> None:
        for client in tuple(self._clients):
            if not client.tell(unit, cut, now_s):
                logger.warning("client %s does not read: closed", client.name)
                client.abort()

    # ------------------------------------------------------------------------- faults

    def _has(self, fault: str, now_s: float) -> bool:
        begin_s = self._faults.get(fault)
        return (
            begin_s is not None
            and self._first_client_s is not None
            and now_s >= self._first_client_s + begin_s
        )

    def _freeze(self) -> None:
        for client in self._clients:
            client.freeze()
