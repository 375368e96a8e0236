"""uvicorn as the console runs it: on a given socket, with or without TLS, until cancelled."""

import asyncio
import contextlib
import logging
import socket
import ssl
from collections.abc import Callable, Iterator
from pathlib import Path

import uvicorn
from starlette.types import ASGIApp

from robomesh.errors import ListenError
from services.console.common.read_scheduler import READS, ReadScheduler, RequestTurns
from services.console.serving.request_timeout import Connection
from services.console.websocket.websocket_transport import WebSocketTransport

log = logging.getLogger(__name__)

_HANDSHAKE_WITHIN_S = 10.0
# A browser with a pulled cable is dropped after 20 s; on a slow line a pong may queue behind video.
_PING_EACH_S = 5.0
_PONG_WITHIN_S = 15.0
_MOST_MESSAGE = 1 << 20
_CERTIFICATE_CHECK_EVERY_S = 10.0


def server_of(app: ASGIApp, tls: ssl.SSLContext | None) -> "Server":
    """Return a server for an application."""
    return Server(
        uvicorn.Config(
            RequestTurns(app),
            ws=WebSocketTransport,
            ws_per_message_deflate=False,
            ws_max_size=_MOST_MESSAGE,
            ws_ping_interval=_PING_EACH_S,
            ws_ping_timeout=_PONG_WITHIN_S,
            lifespan="off",
            log_config=None,
            log_level="warning",
            access_log=False,
            server_header=False,
            # Otherwise a client on loopback could name any address, and evade the limit on sign-in attempts.
            proxy_headers=False,
            timeout_graceful_shutdown=1,
            ssl_context_factory=None if tls is None else lambda *_: tls,
        )
    )


class Server(uvicorn.Server):
    """uvicorn without its signal handling: cancelling the service ends it."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals to `robomesh.service.service.run`."""
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Listen, with a time limit for TLS handshakes."""
        context: ssl.SSLContext | None = self.config.ssl
        state = {READS: ReadScheduler()}
        self.servers = [
            await asyncio.get_running_loop().create_server(
                lambda: Connection(config=self.config, server_state=self.server_state, app_state=state),
                sock=listener,
                ssl=context,
                ssl_handshake_timeout=None if context is None else _HANDSHAKE_WITHIN_S,
                backlog=self.config.backlog,
            )
            for listener in sockets or []
        ]
        self.started = True


async def serve_until_cancelled(
    server: Server, listener: socket.socket, address: str, on_ready: Callable[[str], None] | None
) -> None:
    """Serve until the task is cancelled; call `on_ready` with the address once the page can be opened."""
    serving = asyncio.create_task(server.serve(sockets=[listener]))
    try:
        while not server.started and not serving.done():
            await asyncio.sleep(0.005)  # uvicorn has no event for this
        log.info("console %s", address)
        if on_ready is not None:
            on_ready(address)
        await asyncio.shield(serving)
    finally:
        server.should_exit = True
        server.force_exit = True  # browsers reconnect
        await asyncio.gather(serving, return_exceptions=True)


def _no_password() -> str:
    raise ValueError("a key with a password cannot be used: no terminal to ask for it")


def tls_context(certificate: Path, key: Path) -> ssl.SSLContext:
    """Return a server's TLS context, TLS 1.2 or later.

    Raises:
        ListenError: If the files cannot be read, or the key does not belong to the certificate.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    context.options |= ssl.OP_NO_COMPRESSION | ssl.OP_NO_RENEGOTIATION
    context.set_alpn_protocols(["http/1.1"])
    try:
        context.load_cert_chain(certificate, key, password=_no_password)
    except (ssl.SSLError, ValueError):
        reason = "not a certificate and its key (PEM), without a password"
    except OSError as error:
        reason = str(error.strerror)
    else:
        return context
    raise ListenError(
        f"the console's tls = {{ certificate = {str(certificate)!r}, key = {str(key)!r} }}: {reason}"
    )


async def follow_certificate(tls: ssl.SSLContext, certificate: Path, key: Path) -> None:
    """Load renewed certificates until cancelled; open connections keep the old one."""
    seen = _versions(certificate, key)
    while True:
        await asyncio.sleep(_CERTIFICATE_CHECK_EVERY_S)
        if (now := _versions(certificate, key)) == seen:
            continue
        seen = now
        try:
            tls_context(certificate, key)  # validate first: a half-written pair would leave none
            tls.load_cert_chain(certificate, key, password=_no_password)
            log.info("the console's certificate was renewed")
        except (ListenError, OSError) as error:
            log.error("%s; the old certificate remains in use", error)


def _versions(*paths: Path) -> list[tuple[int, int]]:
    found = []
    for path in paths:
        with contextlib.suppress(OSError):
            stat = path.stat()
            found.append((stat.st_ino, stat.st_mtime_ns))
    return found
