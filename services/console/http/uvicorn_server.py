"""uvicorn as the console runs it: on a listener of ours, over TLS or not, until it is cancelled."""

import asyncio
import contextlib
import logging
import socket
import ssl
from collections.abc import Callable, Iterator
from pathlib import Path

import uvicorn
from starlette.types import ASGIApp

from services.console.http.request_timeout import Connection
from services.console.websocket.websocket_transport import Line
from services.errors import ListenError

log = logging.getLogger(__name__)

_HANDSHAKE_WITHIN_S = 10.0
# So a browser whose cable was pulled is gone after 20 s; a slow line's last answer may wait behind video.
_PING_EACH_S = 5.0
_PONG_WITHIN_S = 15.0
_MOST_MESSAGE = 1 << 20
_RENEWED_LOOK_EACH_S = 10.0


def server_of(app: ASGIApp, tls: ssl.SSLContext | None) -> "Server":
    """A server of an application."""
    return Server(
        uvicorn.Config(
            app,
            ws=Line,
            ws_per_message_deflate=False,
            ws_max_size=_MOST_MESSAGE,
            ws_ping_interval=_PING_EACH_S,
            ws_ping_timeout=_PONG_WITHIN_S,
            lifespan="off",
            log_config=None,
            log_level="warning",
            access_log=False,
            server_header=False,
            # Else who comes over loopback names any address, and tries passwords as another each time.
            proxy_headers=False,
            timeout_graceful_shutdown=1,
            ssl_context_factory=None if tls is None else lambda *_: tls,
        )
    )


class Server(uvicorn.Server):
    """uvicorn without its own signal handling: the service is cancelled instead."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leaves the signals to `robomesh.service.run`."""
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Listens; a TLS handshake is given as little time as a request."""
        context: ssl.SSLContext | None = self.config.ssl
        self.servers = [
            await asyncio.get_running_loop().create_server(
                lambda: Connection(config=self.config, server_state=self.server_state, app_state={}),
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
    """Serves until the running task is cancelled; `on_ready` is told the address once it can be opened."""
    serving = asyncio.create_task(server.serve(sockets=[listener]))
    try:
        while not server.started and not serving.done():
            await asyncio.sleep(0.005)  # uvicorn tells in no other way
        log.info("console %s", address)
        if on_ready is not None:
            on_ready(address)
        await asyncio.shield(serving)
    finally:
        server.should_exit = True
        server.force_exit = True  # browsers come back by themselves
        await asyncio.gather(serving, return_exceptions=True)


def _no_password() -> str:
    raise ValueError("nobody is there to type it")


def tls_context(certificate: Path, key: Path) -> ssl.SSLContext:
    """TLS of a server: 1.2 at least.

    Raises:
        ListenError: If the files cannot be read, or do not belong together.
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
    """Takes up a certificate that was renewed, until it is cancelled; open connections keep theirs."""
    seen = _versions(certificate, key)
    while True:
        await asyncio.sleep(_RENEWED_LOOK_EACH_S)
        if (now := _versions(certificate, key)) == seen:
            continue
        seen = now
        try:
            tls_context(certificate, key)  # apart: half a change would leave none
            tls.load_cert_chain(certificate, key, password=_no_password)
            log.info("the console's certificate was renewed")
        except (ListenError, OSError) as error:
            log.error("%s; the certificate before stays", error)


def _versions(*paths: Path) -> list[tuple[int, int]]:
    found = []
    for path in paths:
        with contextlib.suppress(OSError):
            stat = path.stat()
            found.append((stat.st_ino, stat.st_mtime_ns))
    return found
