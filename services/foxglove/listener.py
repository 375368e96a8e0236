"""Proxy in front of the SDK's server, which checks neither the Origin header nor TLS.

Any web page can open a WebSocket to the machine that shows it, so pages are admitted by the Origin header of
the handshake. Bytes after the handshake are forwarded unchanged. The SDK itself listens on a random address
of 127.0.0.0/8 and a random port.
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

from robomesh.errors import UnavailableError
from robomesh.listen_address import is_loopback
from services.foxglove.settings import ORIGINS

log = logging.getLogger(__name__)

_MAX_HEAD = 16 * 1024
_HEAD_TIMEOUT_S = 10.0
_MAX_CLIENTS = 32
# Connections of one address and of all, including those before their handshake.
_MAX_OF_ADDRESS = 16
_MAX_CONNECTIONS = 256
_BUSY = "503 Service Unavailable"
_SEND_TIMEOUT_MS = 20_000
_PIECE = 64 * 1024
# Bytes buffered here for a slow client; the SDK queues the rest and drops the oldest.
_MAX_BUFFERED = 64 * 1024


def hidden_address() -> str:
    """Return a random loopback address, one of sixteen million."""
    return "127." + ".".join(str(1 + secrets.randbelow(254)) for _ in range(3))


def is_allowed_origin(origin: str | None, allowed: tuple[str, ...]) -> bool:
    """Return whether a client may connect: programs, pages of this machine, and allowed origins may."""
    if origin is None:
        return True
    try:
        host = urlsplit(origin).hostname or ""
    except ValueError:  # http://[
        return False
    return origin in allowed or is_loopback(host)


class Listener:
    """Accepts clients and forwards their bytes to the SDK's server.

    Attributes:
        client_count: Number of clients after their handshake.
    """

    def __init__(self, server_host: str, server_port: int, origins: tuple[str, ...]) -> None:
        self._server = server_host, server_port
        self._origins = (*ORIGINS, *origins)
        self.client_count = 0
        self._per_address: Counter[str] = Counter()
        self._connections: set[asyncio.Task[None]] = set()

    @asynccontextmanager
    async def open(self, host: str, port: int, tls: ssl.SSLContext | None) -> AsyncIterator[int]:
        """Listen during the block and yield the port; end all connections at its end.

        Raises:
            UnavailableError: If it cannot listen on the address.
        """
        try:
            listener = await asyncio.start_server(
                self._on_connect,
                host,
                port,
                ssl=tls,
                limit=_MAX_HEAD,
                ssl_handshake_timeout=_tls_timeout_s(tls),
            )
        except OSError as error:
            reason = os.strerror(error.errno) if error.errno else str(error)
            raise UnavailableError(
                f"foxglove cannot listen on {host}:{port}: {reason}; choose another address with --listen"
            ) from None
        try:
            yield listener.sockets[0].getsockname()[1]
        finally:
            listener.close()
            for task in self._connections:
                task.cancel()
            await asyncio.gather(*self._connections, return_exceptions=True)

    def _on_connect(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        # An explicit task: Python 3.11 logs a traceback when the task that asyncio would create is cancelled.
        task = asyncio.create_task(self._serve(reader, writer))
        self._connections.add(task)
        task.add_done_callback(self._connections.discard)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        address = str((writer.get_extra_info("peername") or ("",))[0])
        self._per_address[address] += 1
        try:
            if self._per_address[address] > _MAX_OF_ADDRESS or self._per_address.total() > _MAX_CONNECTIONS:
                await _refuse(
                    writer, _BUSY, f"too many connections: at most {_MAX_OF_ADDRESS} of one address"
                )
            else:
                await self._accept(reader, writer)
        except (TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, OSError):
            pass  # not a WebSocket client, or it has disconnected
        finally:
            self._per_address[address] -= 1
            if not self._per_address[address]:
                del self._per_address[address]
            writer.close()

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        async with asyncio.timeout(_HEAD_TIMEOUT_S):
            head = await reader.readuntil(b"\r\n\r\n")
        origin = origin_of(head)
        if not is_allowed_origin(origin, self._origins):
            log.warning("refused a page of %s; allow it with --origin %s", origin, origin)
            await _refuse(writer, "403 Forbidden", f"pages of {origin} may not connect here")
            return
        if self.client_count >= _MAX_CLIENTS:
            await _refuse(writer, _BUSY, f"too many clients: at most {_MAX_CLIENTS}")
            return
        self.client_count += 1
        try:
            await self._forward(head, reader, writer)
        finally:
            self.client_count -= 1

    async def _forward(self, head: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        server_reader, server_writer = await asyncio.open_connection(*self._server)
        pumps: list[asyncio.Task[None]] = []
        try:
            for end in (writer, server_writer):
                end.transport.set_write_buffer_limits(high=_MAX_BUFFERED)
            # A client that acknowledges nothing for this long has lost its connection.
            connection = writer.get_extra_info("socket")
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _SEND_TIMEOUT_MS)
            server_writer.write(head)
            pumps.append(asyncio.create_task(_pump(reader, server_writer)))
            pumps.append(asyncio.create_task(_pump(server_reader, writer)))
            await asyncio.wait(pumps, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for pump in pumps:
                pump.cancel()
            await asyncio.gather(*pumps, return_exceptions=True)
            server_writer.close()


def origin_of(head: bytes) -> str | None:
    """Return the Origin header of a handshake, or None if it has none."""
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


def _tls_timeout_s(tls: ssl.SSLContext | None) -> float | None:
    return None if tls is None else _HEAD_TIMEOUT_S
