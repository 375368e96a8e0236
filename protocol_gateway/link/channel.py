"""One channel of a link: connects, serves the connection to its end, and connects again after a pause.

attempt --connected--> serve --lost, or mute for too long--> a pause, 0.2 s growing to 5 s --> attempt
                             --bytes could not be sent-----> immediately, then each 0.2 s
"""

import asyncio
import contextlib
import math
import random
from typing import Protocol

from protocol_gateway.link.connection import Connection, Datagrams, reason_of
from protocol_gateway.link.reader_process import ReaderProcess, ReaderProcessError
from protocol_gateway.seam import Channel
from protocol_gateway.seam.errors import LinkDownError
from robomesh import reason_codes as codes
from robomesh.reasons import Reason

_FIRST_PAUSE_S = 0.2
_LONGEST_PAUSE_S = 5.0
# A program's imports cost most of a second of CPU at each attempt.
_LONGEST_PROGRAM_PAUSE_S = 30.0


class Listener(Protocol):
    """Callbacks of a channel, on the event loop; an exception ends the channel's `run`."""

    def on_opened(self, kept: "KeptChannel") -> None:
        """Handle a new connection."""
        ...

    def on_received(self, kept: "KeptChannel", data: bytes) -> None:
        """Handle the bytes of one read, or a datagram."""
        ...

    def on_ended(self, kept: "KeptChannel") -> bool:
        """Handle the end of a connection, or a failed attempt; return whether a connection was of use."""
        ...

    def patience(self, kept: "KeptChannel") -> float | Reason:
        """Return seconds until the next call, or why the connection must end now."""
        ...


class KeptChannel:
    """A channel that is kept connected.

    Args:
        settings: What a channel's program is started with.

    Attributes:
        channel: The driver's channel.
        where: Its address, for texts.
        reason: Why it is not connected, or was not before.
        connection: None: not connected.
    """

    def __init__(
        self,
        channel: Channel,
        host: str,
        port: int,
        timeout_s: float,
        listener: Listener,
        settings: str = "",
    ) -> None:
        self.channel = channel
        self.where = f"{host}:{port}"
        self.reason: Reason = codes.LINK_CONNECTING(where=self.where)
        self.connection: Connection | Datagrams | ReaderProcess | None = None
        self._settings = settings
        self._host, self._port, self._timeout_s = host, port, timeout_s
        self._listener = listener
        self._send_failed = asyncio.Event()
        # The last attempt came so far that the channel's program was started.
        self._began = False

    async def run(self) -> None:
        """Keep the channel connected until cancelled; then close the connection."""
        pause_s = _FIRST_PAUSE_S
        while True:
            self._began = False
            if await self._attempt():
                pause_s = _FIRST_PAUSE_S
            await self._rest(pause_s)
            pause_s = min(pause_s * 2.0, _LONGEST_PROGRAM_PAUSE_S if self._began else _LONGEST_PAUSE_S)

    def hurry(self) -> None:
        """Connect without long pauses, until bytes were sent."""
        self._send_failed.set()

    def write(self, data: bytes) -> None:
        """Write whole bytes to the socket immediately.

        Until the next successful call the channel connects without long pauses.

        Raises:
            LinkDownError: If there is no connection.
            LinkCloggedError: If the socket does not take all bytes; the connection is then aborted.
        """
        self.hurry()
        if self.connection is None:
            raise LinkDownError(self.reason)
        self.connection.write(data)
        self._send_failed.clear()

    @property
    def round_trip_s(self) -> float | None:
        """Round-trip time to the controller's host [s]; None: unknown."""
        return None if self.connection is None else self.connection.round_trip_s

    async def _rest(self, pause_s: float) -> None:
        """Pause between two attempts; only briefly after bytes could not be sent."""
        # Random spread, so that a restarted controller does not get all connections at the same time.
        spread = random.uniform(0.8, 1.2)
        if self._send_failed.is_set():
            await asyncio.sleep(_FIRST_PAUSE_S * spread)
            return
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(pause_s * spread):
                await self._send_failed.wait()

    async def _attempt(self) -> bool:
        """Connect, and serve the connection to its end; return whether it was of use."""
        try:
            async with asyncio.timeout(self._timeout_s):
                connection = await self._connect()
            if isinstance(connection, ReaderProcess):
                self._began = True
                await connection.connected()
        except TimeoutError:
            return self._attempt_failed(codes.LINK_NO_ANSWER(where=self.where))
        except OSError as error:
            return self._attempt_failed(codes.LINK_FAILED(where=self.where, detail=reason_of(error)))
        except ReaderProcessError as error:
            return self._attempt_failed(codes.LINK_FAILED(where=self.where, detail=error))
        of_use = False
        try:
            self.reason = await self._serve(connection)
        finally:
            self.connection = None
            try:
                of_use = self._listener.on_ended(self)
            finally:
                await connection.end()
        return of_use

    def _attempt_failed(self, reason: Reason) -> bool:
        # It may have been connected in the moment when the time was over.
        self.connection = None
        self.reason = reason
        self._listener.on_ended(self)
        return False

    async def _connect(self) -> Connection | Datagrams | ReaderProcess:
        loop = asyncio.get_running_loop()
        if self.channel.program:
            # A controller that is off costs no process.
            probe, _ = await loop.create_connection(asyncio.Protocol, self._host, self._port)
            probe.close()
            return await ReaderProcess.started(
                self.channel.program,
                (self._host, str(self._port), self._settings),
                self._on_connected,
                self._on_received,
            )
        if self.channel.datagrams:
            _, datagrams = await loop.create_datagram_endpoint(
                lambda: Datagrams(self._on_connected, self._on_received),
                remote_addr=(self._host, self._port),
            )
            return datagrams
        _, connection = await loop.create_connection(
            lambda: Connection(self._on_connected, self._on_received), self._host, self._port
        )
        return connection

    async def _serve(self, connection: Connection | Datagrams | ReaderProcess) -> Reason:
        """Wait for the connection's end; return its reason."""
        while not connection.lost.done():
            wait_s = self._listener.patience(self)
            if isinstance(wait_s, Reason):
                return wait_s
            await asyncio.wait([connection.lost], timeout=None if wait_s == math.inf else wait_s)
        return codes.LINK_LOST(connection.lost.result(), where=self.where)

    def _on_connected(self, connection: Connection | Datagrams | ReaderProcess) -> None:
        self.connection = connection
        self.reason = codes.LINK_CLOSED()
        self._listener.on_opened(self)

    def _on_received(self, data: bytes) -> None:
        self._listener.on_received(self, data)
