"""The door before the SDK's server, which asks nobody where they come from and knows no TLS of a mesh.

A web page of anywhere can open a WebSocket to the machine that shows it: pages of others are sent away by
the Origin that browsers tell. What comes after the handshake is passed on as it is. The SDK itself listens
on an address of 127.0.0.0/8 and a port that nobody can guess.
"""

import asyncio
import contextlib
import logging
import os
import secrets
import socket
import ssl
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from urllib.parse import urlsplit

from services.errors import ListenError
from services.foxglove.settings import ORIGINS
from services.site_file.listen_address import is_loopback

log = logging.getLogger(__name__)

_MOST_HEAD = 16 * 1024
_HEAD_WITHIN_S = 10.0
_MOST_CLIENTS = 32
# Connections of one address, and of all, those that say nothing among them.
_MOST_OF_ONE = 16
_MOST_CONNECTIONS = 256
_BUSY = "503 Service Unavailable"
_TAKES_WITHIN_MS = 20_000
_PIECE = 64 * 1024
# Waits here for a client that reads slowly; the rest waits at the SDK, which drops the oldest.
_MOST_WAITING = 64 * 1024


def hidden_address() -> str:
    """An address of this machine alone, one of sixteen million."""
    return "127." + ".".join(str(1 + secrets.randbelow(254)) for _ in range(3))


def welcome(origin: str | None, allowed: tuple[str, ...]) -> bool:
    """Whether a client may attach: a program, a page of this machine's, or one that is allowed."""
    if origin is None:
        return True
    try:
        host = urlsplit(origin).hostname or ""
    except ValueError:  # http://[
        return False
    return origin in allowed or is_loopback(host)


class Door:
    """Lets clients in and passes their bytes on.

    Attributes:
        inside: How many there are, their handshakes over.
    """

    def __init__(self, server_host: str, server_port: int, origins: tuple[str, ...]) -> None:
        self._server = server_host, server_port
        self._origins = (*ORIGINS, *origins)
        self.inside = 0
        self._open: Counter[str] = Counter()
        self._visits: set[asyncio.Task[None]] = set()

    @asynccontextmanager
    async def open(self, host: str, port: int, tls: ssl.SSLContext | None) -> AsyncIterator[int]:
        """Listen while the block runs, and no visit outlives it; on which port.

        Raises:
            ListenError: If it cannot.
        """
        try:
            listener = await asyncio.start_server(
                self._came, host, port, ssl=tls, limit=_MOST_HEAD, ssl_handshake_timeout=_tls_within(tls)
            )
        except OSError as error:
            reason = os.strerror(error.errno) if error.errno else str(error)
            raise ListenError(
                f"foxglove cannot listen on {host}:{port}: {reason}; --listen another"
            ) from None
        try:
            yield listener.sockets[0].getsockname()[1]
        finally:
            listener.close()
            for visit in self._visits:
                visit.cancel()
            await asyncio.gather(*self._visits, return_exceptions=True)

    def _came(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        # A task of ours: of one that asyncio makes itself, Python 3.11 logs a traceback when it is cancelled.
        visit = asyncio.create_task(self._serve(reader, writer))
        self._visits.add(visit)
        visit.add_done_callback(self._visits.discard)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        address = str((writer.get_extra_info("peername") or ("",))[0])
        self._open[address] += 1
        try:
            if self._open[address] > _MOST_OF_ONE or self._open.total() > _MOST_CONNECTIONS:
                await _refuse(writer, _BUSY, f"too many connections: {_MOST_OF_ONE} of an address at most")
            else:
                await self._let_in(reader, writer)
        except (TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, OSError):
            pass  # it is no WebSocket client, or it has gone
        finally:
            self._open[address] -= 1
            if not self._open[address]:
                del self._open[address]
            writer.close()

    async def _let_in(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        async with asyncio.timeout(_HEAD_WITHIN_S):
            head = await reader.readuntil(b"\r\n\r\n")
        origin = origin_of(head)
        if not welcome(origin, self._origins):
            log.warning("a page of %s was sent away: --origin %s lets it attach", origin, origin)
            await _refuse(writer, "403 Forbidden", f"pages of {origin} may not attach here")
            return
        if self.inside >= _MOST_CLIENTS:
            await _refuse(writer, _BUSY, f"more than {_MOST_CLIENTS} clients")
            return
        self.inside += 1
        try:
            await self._pass_on(head, reader, writer)
        finally:
            self.inside -= 1

    async def _pass_on(self, head: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        server_reader, server_writer = await asyncio.open_connection(*self._server)
        for end in (writer, server_writer):
            end.transport.set_write_buffer_limits(high=_MOST_WAITING)
        # Who takes nothing of what was sent for so long is gone: its cable was pulled.
        line = writer.get_extra_info("socket")
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _TAKES_WITHIN_MS)
        server_writer.write(head)
        pumps = [
            asyncio.create_task(_pump(reader, server_writer)),
            asyncio.create_task(_pump(server_reader, writer)),
        ]
        try:
            await asyncio.wait(pumps, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for pump in pumps:
                pump.cancel()
            await asyncio.gather(*pumps, return_exceptions=True)
            server_writer.close()


def origin_of(head: bytes) -> str | None:
    """The page that a handshake comes from; None: it comes from none."""
    for line in head.decode("latin-1").split("\r\n")[1:]:
        name, _, value = line.partition(":")
        if name.strip().lower() == "origin":
            return value.strip()
    return None


async def _pump(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with contextlib.suppress(OSError):
        while data := await reader.read(_PIECE):
            writer.write(data)
            await writer.drain()


async def _refuse(writer: asyncio.StreamWriter, status: str, text: str) -> None:
    body = f"{text}\n".encode()
    head = f"HTTP/1.1 {status}\r\nContent-Type: text/plain\r\nContent-Length: {len(body)}\r\n"
    writer.write(head.encode("latin-1", "replace") + b"Connection: close\r\n\r\n" + body)
    await writer.drain()


def _tls_within(tls: ssl.SSLContext | None) -> float | None:
    return None if tls is None else _HEAD_WITHIN_S
