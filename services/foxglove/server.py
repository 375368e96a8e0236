"""Foxglove service: serves the mesh to Foxglove and Lichtblick."""

import asyncio
import logging
import ssl
from collections.abc import Callable

from robomesh.contract.keys import check_chunk
from robomesh.errors import ListenError
from robomesh.listen_address import check_reach, is_loopback, split_address
from robomesh.service.linked_site import be_present
from robomesh.wire.session import Session
from services.foxglove.bridge import Bridge
from services.foxglove.commands import Commands
from services.foxglove.listener import Listener, hidden_address
from services.foxglove.settings import Settings

log = logging.getLogger(__name__)

SERVICE = "foxglove"
# The SDK's log lines of connections show only the proxy and the hidden address.
_SDK_LOG = "foxglove.websocket"


async def serve(
    session: Session, settings: Settings, *, on_ready: Callable[[str], None] | None = None
) -> None:
    """Serve until cancelled.

    Args:
        on_ready: Called with the address once clients can connect.

    Raises:
        ListenError: If it cannot listen on the address, or is not permitted to.
    """
    host, port = split_address(settings.listen)
    tls = _tls(settings)
    commanded = is_loopback(host)
    if not (commanded or tls or settings.insecure):
        raise ListenError(
            f"foxglove would listen on {host}, which other machines can reach, without TLS: add "
            "--certificate PEM, listen on 127.0.0.1, or add --insecure"
        )
    if warning := check_reach("foxglove", host, secured=tls is not None, insecure=True):
        log.warning("%s", warning)
    if settings.operator:
        check_chunk(settings.operator)
        if not commanded:
            raise ListenError(
                f"foxglove would accept commands on {host} but has no sign-in: commands are offered on "
                "loopback only; omit --operator, or listen on 127.0.0.1"
            )
    bridge = Bridge(session, settings)
    commands = Commands(session, settings.operator, bridge.channels.watches) if commanded else None
    logging.getLogger(_SDK_LOG).setLevel(logging.CRITICAL)
    hidden = hidden_address()
    server = bridge.start(hidden, name=_name(settings, commanded=commanded), commands=commands)
    try:
        listener = Listener(hidden, server.port, settings.origins)
        session.measure("foxglove_clients", "Connected Foxglove clients", lambda: listener.client_count)
        session.measure("foxglove_watched", "Channels with a client", lambda: bridge.channels.watched)
        async with listener.open(host, port, tls) as bound:
            shown = f"[{host}]" if ":" in host else host
            address = f"{'ws' if tls is None else 'wss'}://{shown}:{bound}"
            log.info("foxglove %s", address)
            if on_ready is not None:
                on_ready(address)
            async with asyncio.TaskGroup() as group:
                group.create_task(be_present(session, SERVICE, site=settings.site, metrics=settings.metrics))
                group.create_task(bridge.follow_presence())
                group.create_task(bridge.follow_descriptions())
    finally:
        if commands is not None:
            await commands.close()
        bridge.channels.close()
        await asyncio.to_thread(server.stop)


def _name(settings: Settings, *, commanded: bool) -> str:
    """Return the server's name, which shows the user the offered commands."""
    if not commanded:
        return "robomesh (read-only: commands are offered on loopback only)"
    if not settings.operator:
        return "robomesh (stop only: commands need --operator)"
    return f"robomesh (commands in the name of {settings.operator})"


def _tls(settings: Settings) -> ssl.SSLContext | None:
    """Return the TLS context of the settings, or None without a certificate.

    Raises:
        ListenError: If a file cannot be used.
    """
    if settings.certificate is None:
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        context.load_cert_chain(settings.certificate, settings.private_key)
    except (OSError, ssl.SSLError) as error:
        raise ListenError(
            f"foxglove: {settings.certificate} cannot be used as its certificate, with "
            f"{settings.private_key or 'the key in it'}: {error.strerror or error}"
        ) from None
    return context
